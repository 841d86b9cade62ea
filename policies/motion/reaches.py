"""Random arm reaches: what the arms do in the walking bench, and in training beside or without motion clips.

Min-jerk reaches of 0.5 to 2 s between joint targets drawn uniformly from home + amplitude x (range - home); 15 % hold.
"""

from __future__ import annotations

import numpy as np

from policies.motion.clip import Clip, ClipSet
from robots.spec import RobotSpec

RANGES = {
    "torso": (-0.8, 0.8),
    "shoulder_pitch": (-1.6, 0.6),
    "shoulder_roll": (-0.1, 1.2),
    "shoulder_yaw": (-0.9, 0.9),
    "elbow_pitch": (-0.2, 1.9),
    "elbow_roll": (-1.2, 1.2),
    "wrist_pitch": (-0.4, 0.4),
    "wrist_yaw": (-0.7, 0.7),
}
"""Joint -> range of the reaches [rad], left side; clipped to the robot's limits."""
SECONDS = (0.5, 2.0)
HOLD = 0.15


class Reaches:
    """Upper-body targets [count, 15] (waist and arms, motor order) for many robots."""

    def __init__(self, spec: RobotSpec, count: int, dt: float, rng: np.random.Generator) -> None:
        self._rng, self._dt = rng, dt
        upper = spec.group("waist", "arms")
        self.home = spec.home[upper]
        self.low, self.high = _ranges(spec, upper)
        self.amplitude = np.ones(count)
        """Share of the range that is used, a robot [count]."""
        self._from = np.tile(self.home, (count, 1))
        self._to = self._from.copy()
        self._age, self._length = np.zeros(count), np.zeros(count)
        self.reset(np.ones(count, bool))

    def reset(self, mask: np.ndarray) -> None:
        """Arms at home, a new reach begins."""
        self._from[mask] = self._to[mask] = self.home
        self._draw(mask)

    def step(self) -> np.ndarray:
        """Targets one tick later [count, 15], rad."""
        self._age += self._dt
        self._draw(self._age > self._length)
        return self.at(0.0)

    def at(self, ahead: float) -> np.ndarray:
        """Targets `ahead` seconds from now, within the present reach [count, 15], rad."""
        s = np.clip((self._age + ahead) / self._length, 0, 1)[:, None]
        return self._from + (self._to - self._from) * (10 * s**3 - 15 * s**4 + 6 * s**5)

    def _draw(self, mask: np.ndarray) -> None:
        count = int(mask.sum())
        if not count:
            return
        goal = self.home + self.amplitude[mask, None] * (self._rng.uniform(self.low, self.high, (count, len(self.home))) - self.home)
        hold = self._rng.random(count) < HOLD
        self._from[mask] = self._to[mask]
        self._to[mask] = np.where(hold[:, None], self._from[mask], goal)
        self._length[mask] = self._rng.uniform(*SECONDS, count)
        self._age[mask] = 0


def clips(spec: RobotSpec, count: int, rng: np.random.Generator, seconds: float = 12.0) -> ClipSet:
    """Reaches over the whole range as `count` clips to train on."""
    dt = 1 / spec.policy_rate
    reaches = Reaches(spec, count, dt, rng)
    q = np.stack([reaches.step() for _ in range(round(seconds / dt))], 1).astype(np.float32)
    still, height = np.zeros((q.shape[1], 3), np.float32), np.full(q.shape[1], spec.nominal_height, np.float32)
    made = (Clip(f"reaches-{i}", spec.policy_rate, row, still, height, "none", "train", "synthetic") for i, row in enumerate(q))
    return ClipSet.of(spec, made, "random reaches")


def _ranges(spec: RobotSpec, upper: slice) -> tuple[np.ndarray, np.ndarray]:
    low, high = [], []
    for joint in spec.motors[upper]:
        a, b = RANGES[joint.name.removeprefix("left_").removeprefix("right_").removesuffix("_joint")]
        if joint.name.startswith("right_") and abs(joint.axis[1]) < 0.5:
            a, b = -b, -a
        low.append(max(a, joint.lower))
        high.append(min(b, joint.upper))
    return np.array(low), np.array(high)
