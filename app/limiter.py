"""Turns what the operator asks into what the robot can follow: what the legs are trained for, accelerations, wrist speeds."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np

from app.one_euro import OneEuro, turn_between
from policies.command import Command
from policies.envelope import next_posture, next_twist, towards

NECK = np.array([[-1.5, -0.9], [1.5, 1.2]])
"""Neck yaw and pitch: lower, upper [2, 2], rad."""
WAIST = 0.8
"""Largest waist yaw [rad]."""

WRIST_SPEED, WRIST_TURN = 1.0, 3.0
"""m/s, rad/s"""
HAND_RATE, NECK_RATE, WAIST_RATE = 5.0, 3.0, 1.0
"""1/s, rad/s, rad/s"""
STOP_TIME = 0.08
"""From any velocity command to zero once the operator is lost [s]; with 200 ms of silence before, 300 ms are kept."""

JUMP, JUMP_TURN = 0.25, np.deg2rad(60)
"""A target that moves further than this in one message lets go of the wrist [m], [rad]."""


class Limiter:
    """Keeps the command that the robot follows now; each step moves it a tick's worth, never further."""

    def __init__(self, home: Command, dt: float) -> None:
        """Start from `home`; a step lasts dt [s]."""
        self.dt = dt
        self.applied = home.still()
        self.let_go = np.zeros(2, dtype=bool)
        self._asked: list[np.ndarray | None] = [None, None]
        self._filters: list[OneEuro | None] = [None, None]
        self._brake = np.zeros(3)

    def engage(self) -> None:
        """The next target counts from here, however far it is: the wrists go there at their own speed."""
        self._asked, self._filters = [None, None], [None, None]
        self.let_go[:] = False

    @property
    def delay(self) -> float:
        """What the filter of the wrists costs now [s]."""
        return max((smoother.delay for smoother in self._filters if smoother), default=0.0)

    def step(self, wanted: Command, given: np.ndarray, smooth: bool, arms: bool, legs: bool, elapsed: float) -> Command:
        """A tick's worth towards `wanted` (finite) where the operators are followed; the rest holds.

        Args:
            wanted: what is asked.
            given: which wrists the operator has set, left and right [2].
            smooth: whether the wrists' targets are filtered, once a jump was ruled out.
            arms: whether wrists, hands, neck and waist follow; otherwise they stay.
            legs: whether velocity and posture follow; otherwise the velocity is braked to zero and the posture stays.
            elapsed: time since the last step [s].
        """
        fields = (self._reach(wanted, given, smooth) if arms else {}) | (self._walk(wanted) if legs else self._stand(elapsed))
        self.applied = replace(self.applied, engage=arms or legs, **fields)
        return self.applied

    def _reach(self, wanted: Command, given: np.ndarray, smooth: bool) -> dict:
        """The arms' fields."""
        now, dt = self.applied, self.dt
        return {
            "wrists": np.stack([self._wrist(side, wanted.wrists[side], bool(given[side]), smooth) for side in (0, 1)]),
            "hands": towards(now.hands, np.clip(wanted.hands, 0, 1), HAND_RATE * dt),
            "neck": towards(now.neck, np.clip(wanted.neck, *NECK), NECK_RATE * dt),
            "waist": float(towards(np.array(now.waist), np.clip(wanted.waist, -WAIST, WAIST), WAIST_RATE * dt)),
        }

    def _walk(self, wanted: Command) -> dict:
        """The legs' fields."""
        now, dt = self.applied, self.dt
        twist = next_twist(now.twist, wanted.twist, dt)
        height, roll, pitch = next_posture(now.posture, wanted.posture, dt)
        self._brake = np.abs(twist) / STOP_TIME
        return {"twist": twist, "height": float(height), "roll": float(roll), "pitch": float(pitch)}

    def _stand(self, elapsed: float) -> dict:
        """The legs' fields while nobody is followed: to zero velocity within STOP_TIME."""
        brake = self._brake * elapsed + 1e-9  # so that rounding leaves no creep
        return {"twist": towards(self.applied.twist, np.zeros(3), brake)}

    def _wrist(self, side: int, asked: np.ndarray, given: bool, smooth: bool) -> np.ndarray:
        """The next pose of one wrist [7]."""
        now = self.applied.wrists[side]
        if not given:
            return now
        before, self._asked[side] = self._asked[side], asked
        if before is not None and _far(before, asked):
            self.let_go[side] = True
        elif self.let_go[side] and not _far(now, asked):
            self.let_go[side] = False
        if self.let_go[side] or not smooth:
            self._filters[side] = None
        if self.let_go[side]:
            return now
        return _pose_towards(now, self._smoothed(side, asked) if smooth else asked, WRIST_SPEED * self.dt, WRIST_TURN * self.dt)

    def _smoothed(self, side: int, asked: np.ndarray) -> np.ndarray:
        """The filtered target [7]; a filter begins where the wrist is."""
        smoother = self._filters[side] or OneEuro(self.applied.wrists[side], self.dt)
        self._filters[side] = smoother
        return smoother.step(asked)


def _far(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(np.linalg.norm(b[:3] - a[:3]) > JUMP or np.linalg.norm(turn_between(a[3:], b[3:])) > JUMP_TURN)


def _pose_towards(now: np.ndarray, goal: np.ndarray, distance: float, angle: float) -> np.ndarray:
    """The pose [7] on the way to goal, at most distance [m] and angle [rad] away from now."""
    way, turn = goal[:3] - now[:3], turn_between(now[3:], goal[3:])
    share = min(1.0, distance / max(float(np.linalg.norm(way)), 1e-12))
    turn_share = min(1.0, angle / max(float(np.linalg.norm(turn)), 1e-12))
    quaternion = now[3:].copy()
    mujoco.mju_quatIntegrate(quaternion, turn, turn_share)
    return np.concatenate([now[:3] + share * way, quaternion / np.linalg.norm(quaternion)])
