"""One driver's part of the command, put together from messages that need not be complete."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from app.arbiter import Role
from app.protocol import OperatorMessage, Pose
from policies.command import Command


@dataclass(frozen=True)
class Merged:
    """Of every field of a role the newest value counts, from the last press of Engage on."""

    role: Role
    command: Command = field(default_factory=Command)
    """Only the role's fields of it count, and `engage`."""
    given: tuple[bool, bool] = (False, False)
    """Which wrists were set since the last press, left and right."""
    smooth: bool = False
    """The wrists' targets shall be filtered."""
    presses: int = 0
    """Fresh presses of Engage: released before, pressed now."""

    def handed_over(self, engaged: bool = False) -> Merged:
        """Another driver begins, or none; an Engage that is held already (`engaged`) is no press."""
        return replace(self, command=replace(self.command, engage=engaged).still(), smooth=False)

    def with_message(self, message: OperatorMessage, applied: Command) -> Merged:
        """What the message says on top. A press starts from `applied`, what the robot does now."""
        base = self
        if message.engage and not self.command.engage:
            base = Merged(self.role, applied.still(), smooth=self.smooth, presses=self.presses + 1)
        fields = _arms(message, base.command) if self.role == "arms" else _legs(message)
        if message.engage is not None:
            fields["engage"] = message.engage
        given = self.role == "arms" and message.wrists and (message.wrists.left is not None, message.wrists.right is not None)
        left, right = given or (False, False)
        smooth = self.smooth if message.smooth is None else message.smooth
        given = (base.given[0] or left, base.given[1] or right)
        return replace(base, command=replace(base.command, **fields), smooth=smooth, given=given)


def combined(arms: Command, legs: Command) -> Command:
    """The whole robot's command from what its drivers ask."""
    return replace(arms, engage=arms.engage or legs.engage, twist=legs.twist, height=legs.height, roll=legs.roll, pitch=legs.pitch)


def _legs(message: OperatorMessage) -> dict:
    """The legs' fields of a Command that a message sets."""
    fields: dict = {name: value for name in ("height", "roll", "pitch") if (value := getattr(message, name)) is not None}
    if message.twist:
        fields["twist"] = np.array([message.twist.vx, message.twist.vy, message.twist.yaw_rate])
    return fields


def _arms(message: OperatorMessage, before: Command) -> dict:
    """The arms' fields of a Command that a message sets."""
    fields: dict = {} if message.waist is None else {"waist": message.waist}
    if message.neck:
        fields["neck"] = np.array([message.neck.yaw, message.neck.pitch])
    if message.wrists:
        poses = [pose and _pose_vector(pose) for pose in (message.wrists.left, message.wrists.right)]
        fields["wrists"] = _sides(poses, before.wrists)
    if message.hands:
        fields["hands"] = _sides([message.hands.left, message.hands.right], before.hands)
    return fields


def _sides(new: list, before: np.ndarray) -> np.ndarray:
    return np.stack([was if value is None else np.asarray(value) for value, was in zip(new, before, strict=True)])


def _pose_vector(pose: Pose) -> np.ndarray:
    return np.array([*pose.position, *pose.quaternion])
