"""A retargeted clip as a source of commands: it drives the arms, over and over, and leaves the legs to people.

Through the same lease, guard and limits as an operator's hands: wrists and waist are the clip's, elbows are as inverse kinematics has
them. Whoever takes the arms has them for good: the clip begins anew when the robot is reset while nobody else drives them.
Stop stops it until somebody presses Engage.
"""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np

from app.arbiter import ROLES, Role
from app.errors import OddSpeed
from app.mode import Mode, Reason
from app.protocol import OperatorMessage, Pose, Wrists
from policies.arm_model import ArmModel
from policies.command import Command
from policies.motion.clip import Clip
from robots.catalog import Robot

PACE, LEAST = 0.8, 1.0
"""Joint speed between home and the clip's ends [rad/s], and the least time that it takes [s]."""
SPEEDS = (0.05, 4.0)
"""Slowest and fastest playback."""
PRESS = 25
"""While the arms do not follow, Engage is pressed anew after so many messages."""
ARMS = ROLES.index("arms")


class Motion:
    """A clip: from home to its first pose, through it, and back home. It waits where it is while the arms do not follow."""

    def __init__(self, robot: Robot, clip: Clip, snapshot: Callable[[], np.void], speed: float = 1.0) -> None:
        """
        Args:
            robot: whose clip it is.
            clip: what to play.
            snapshot: the newest one (app.shared.snapshot_dtype).
            speed: of the playback; 1 is the person's own.

        Raises:
            OddSpeed: it is none of `SPEEDS`.
        """
        if not SPEEDS[0] <= speed <= SPEEDS[1]:
            raise OddSpeed(speed, *SPEEDS)
        self.name = f"clip {clip.name}"[:40]
        self._rate, self._snapshot = clip.rate, snapshot
        self._q = there_and_back(clip, robot.spec.home[robot.spec.group("waist", "arms")], speed)
        self._wrists = _wrists(robot, self._q)
        self._at = self._seconds = 0.0
        self._home = self._taken = False

    @property
    def fastest(self) -> float:
        """Speed of the faster wrist, exceeded in 1 % of the time [m/s]."""
        moved = np.linalg.norm(np.diff(self._wrists[:, :, :3], axis=0), axis=-1)
        return float(np.percentile(moved.max(-1), 99)) * self._rate

    def message(self, seq: int, seconds: float, applied: Command, taken: Collection[Role]) -> OperatorMessage:
        """See app.inputs.source.Source. The clip begins anew when the robot was put back home."""
        snapshot, elapsed = self._snapshot(), seconds - self._seconds
        mode, reason = Mode(snapshot["modes"][ARMS]), Reason(snapshot["reasons"][ARMS])
        before, self._home = self._home, reason in (Reason.STARTED, Reason.RESET)
        reset, self._seconds = self._home and not before, seconds
        self._taken = "arms" in taken or (self._taken and not reset)
        if self._home:
            self._at = 0.0
        elif mode == Mode.ENGAGED and not self._taken:
            self._at = (self._at + elapsed * self._rate) % len(self._q)
        engage = not self._taken and (mode == Mode.ENGAGED or ((mode == Mode.HOLD or self._home) and seq % PRESS != 0))
        at = round(self._at) % len(self._q)
        left, right = (Pose(position=tuple(row[:3]), quaternion=tuple(row[3:])) for row in self._wrists[at].tolist())
        wrists, waist = Wrists(left=left, right=right), float(self._q[at, 0])
        return OperatorMessage(seq=seq, roles=["arms"], engage=engage, wrists=wrists, waist=waist)


def there_and_back(clip: Clip, home: np.ndarray, speed: float = 1.0) -> np.ndarray:
    """Joint angles of waist and arms from home [15] to the clip, through it at a speed, and back home [T, 15], rad."""
    at = np.arange(0, len(clip.q) - 1, speed)
    whole, part = at.astype(int), (at % 1)[:, None]
    played = clip.q[whole] * (1 - part) + clip.q[whole + 1] * part
    return np.concatenate([_way(home, played[0], clip.rate), played, _way(played[-1], home, clip.rate)])


def _way(start: np.ndarray, end: np.ndarray, rate: float) -> np.ndarray:
    """A min-jerk way without its end."""
    seconds = max(1.875 * float(np.abs(end - start).max()) / PACE, LEAST)
    s = np.linspace(0, 1, round(seconds * rate), endpoint=False)[:, None]
    return start + (10 * s**3 - 15 * s**4 + 6 * s**5) * (end - start)


def _wrists(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Wrist poses in the pelvis frame [T, 2, 7]."""
    model, poses = ArmModel(robot), np.empty((len(q), 2, 7))
    for pose, row in zip(poses, q, strict=True):
        model.pose(row)
        pose[:] = model.wrists()
    return poses
