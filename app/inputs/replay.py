"""A recorded operator: says again what was said in an episode, to the robot as it is now."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from app.protocol import Hands, Neck, OperatorMessage, Pose, Twist, Wrists
from policies.command import Command
from policies.episode import DamagedRecording
from policies.recording.reader import Recording


class Replay:
    """The commands of a recording's first episode, as they arrived, at their own pace."""

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
            self._rows = recording.episode(recording.infos[0]).rows["raw"]

    def message(self, seq: int, seconds: float, applied: Command) -> OperatorMessage | None:
        """See app.inputs.source.Source."""
        row = int(seconds * self._rate)
        return _said(seq, Command.from_vector(self._rows[row])) if row < len(self._rows) else None


def _said(seq: int, command: Command) -> OperatorMessage:
    left, right = (Pose(position=tuple(wrist[:3]), quaternion=tuple(wrist[3:])) for wrist in command.wrists.tolist())
    vx, vy, yaw_rate = command.twist.tolist()
    yaw, pitch = command.neck.tolist()
    left_hand, right_hand = (tuple(drives) for drives in np.clip(command.hands, 0, 1).tolist())
    return OperatorMessage(
        seq=seq,
        engage=command.engage and seq > 0,
        twist=Twist(vx=vx, vy=vy, yaw_rate=yaw_rate),
        height=command.height,
        roll=command.roll,
        pitch=command.pitch,
        wrists=Wrists(left=left, right=right),
        hands=Hands(left=left_hand, right=right_hand),
        neck=Neck(yaw=yaw, pitch=pitch),
        waist=command.waist,
    )
