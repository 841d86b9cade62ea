"""Makes a smooth path of wrist targets that arrive less often than the robot ticks (a browser sends 20 a second)."""

from __future__ import annotations

import mujoco
import numpy as np

from policies.pose import wrist_poses

PERIOD = 0.05
"""Seconds between two targets, until it has been measured."""
LONGEST = 0.12
"""A longer silence is a rest, not a period [s]."""


class Interpolator:
    """Each target is reached one measured input period after it came, on a straight line; the newest wins, none is queued."""

    def __init__(self, wrists: np.ndarray, dt: float = 0.02) -> None:
        """Start at the poses [2, 7]. dt: seconds between two calls of `step`."""
        self._dt = dt
        self.reset(wrists)

    def reset(self, wrists: np.ndarray) -> None:
        """Stand at the poses [2, 7]."""
        self._tracks = [_Track(pose, PERIOD / self._dt, LONGEST / self._dt) for pose in np.array(wrists, dtype=float)]

    def step(self, wrists: np.ndarray) -> np.ndarray:
        """Where the wrists shall be this tick [2, 7]. A row that is no pose is handed on as it is and changes nothing."""
        poses = wrist_poses(wrists)
        rows = [track.step(np.array(pose)) if pose else None for track, pose in zip(self._tracks, poses, strict=True)]
        return np.array([np.full(7, np.nan) if row is None else row for row in rows])


class _Track:
    """One wrist. Times are in ticks."""

    def __init__(self, pose: np.ndarray, period: float, longest: float) -> None:
        self._now = self._start = self._goal = pose.copy()
        self._turn = np.zeros(3)
        self._period, self._longest, self._age = period, longest, longest + 1

    def step(self, pose: np.ndarray) -> np.ndarray:
        if (pose != self._goal).any():
            if self._age <= self._longest:
                self._period = (self._period + self._age) / 2
            self._start, self._goal, self._age = self._now, pose, 0
            mujoco.mju_subQuat(self._turn, pose[3:], self._start[3:])
        self._age += 1
        share = min(self._age / self._period, 1.0)
        if share == 1.0:
            self._now = self._goal
            return self._now
        self._now = self._start + share * (self._goal - self._start)
        quaternion = self._start[3:].copy()
        mujoco.mju_quatIntegrate(quaternion, self._turn, share)
        self._now[3:] = quaternion
        return self._now
