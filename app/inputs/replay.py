"""A recorded operator: asks again for what the robot followed in an episode, of the robot as it is now."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import numpy as np

from app.arbiter import Role
from app.protocol import Hands, Neck, OperatorMessage, Pose, Twist, Wrists
from policies.command import AT, Command
from policies.episode import DamagedRecording
from policies.recording.reader import Recording

ARMS = AT["wrists"].start
"""Where the arms' part of a command's vector begins; the legs' is before it."""


class Replay:
    """The commands of a recording's first episode at their own pace, of the roles that were driven in it; the other one stays free."""

    name = "replay"

    def __init__(self, argument: str) -> None:
        """argument: path of a recording.

        Raises:
            DamagedRecording: not a recording, or one without episodes.
            OSError: no such file, no permission.
        """
        with Recording(Path(argument)) as recording:
            if not recording.infos:
                raise DamagedRecording(recording.path, "it has no episode", "choose another one")
            self._rate = recording.metadata.rate
            self._rows = recording.episode(recording.infos[0]).rows["applied"]
        self._roles = driven(self._rows)

    def message(self, seq: int, seconds: float, applied: Command, taken: Collection[Role]) -> OperatorMessage | None:
        """See app.inputs.source.Source."""
        row = int(seconds * self._rate)
        if row >= len(self._rows):
            return None
        command = Command.from_vector(self._rows[row])
        fields = (_arms(command) if "arms" in self._roles else {}) | (_legs(command) if "legs" in self._roles else {})
        return OperatorMessage(seq=seq, roles=self._roles, engage=command.engage and seq > 0, **fields)


def driven(rows: np.ndarray) -> list[Role]:
    """The roles that somebody drove while the robot followed these commands [n, 36]: what nobody drives never changes."""
    arms, legs = ((rows[:, part] != rows[:1, part]).any() for part in (slice(ARMS, None), slice(1, ARMS)))
    walks = rows[:, AT["twist"]].any()
    moved: dict[Role, bool] = {"arms": bool(arms), "legs": bool(legs or walks)}
    return [role for role, did in moved.items() if did]


def _arms(command: Command) -> dict:
    left, right = (Pose(position=tuple(wrist[:3]), quaternion=tuple(wrist[3:])) for wrist in command.wrists.tolist())
    left_hand, right_hand = (tuple(drives) for drives in np.clip(command.hands, 0, 1).tolist())
    yaw, pitch = command.neck.tolist()
    hands, neck = Hands(left=left_hand, right=right_hand), Neck(yaw=yaw, pitch=pitch)
    return {"wrists": Wrists(left=left, right=right), "hands": hands, "neck": neck, "waist": command.waist}


def _legs(command: Command) -> dict:
    vx, vy, yaw_rate = command.twist.tolist()
    twist = Twist(vx=vx, vy=vy, yaw_rate=yaw_rate)
    return {"twist": twist, "height": command.height, "roll": command.roll, "pitch": command.pitch}
