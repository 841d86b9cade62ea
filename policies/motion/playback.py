"""Many robots' arms playing clips, each motion as lively as the legs have earned: the paper's curriculum (section III-C).

A motion i is played as home + alpha_i (motion - home). When a play ends, alpha_i rises by 0.05 if the robot stood through at
least 90 % of it, else it falls by 0.01. A play is a clip, or 12 s of it from a random frame; then the next one begins.
"""

from __future__ import annotations

import numpy as np

from policies.motion.clip import ClipSet
from robots.spec import RobotSpec

RISE, FALL = 0.05, 0.01
SURVIVED = 0.9
LONGEST = 12.0
"""Length of a play [s]."""
BLEND = 1.0
"""Time in which what is left of the pose before dies out when a play begins [s]."""


class Playback:
    """Upper-body targets [count, 15] (waist and arms, motor order) for many robots."""

    def __init__(
        self, spec: RobotSpec, clips: ClipSet, count: int, rng: np.random.Generator, alpha: float = 0.0, fastest: float = 1.0
    ) -> None:
        """alpha: amplitude of every motion to begin with. fastest: half of the plays are hurried, at most so many times."""
        self._rng, self._dt, self._fastest = rng, 1 / spec.policy_rate, fastest
        self.home = spec.home[spec.group("waist", "arms")]
        self.alpha = np.full(len(clips), alpha)
        """Amplitude of each clip."""
        self.adaptive = True
        """Whether alpha follows the paper's rule; without the curriculum it stays."""
        self._q = np.concatenate([clip.q for clip in clips.clips])
        self._twist = np.concatenate([clip.twist for clip in clips.clips])
        self._height = np.concatenate([clip.height for clip in clips.clips])
        self._length = np.array([len(clip.q) for clip in clips.clips])
        self._start = np.cumsum(self._length) - self._length
        zeros = lambda *shape: np.zeros((count, *shape))  # noqa: E731
        self._clip, self._first, self._last, self._ticks, self._age = (zeros().astype(int) for _ in range(5))
        self._pace = np.ones(count)  # clip frames a tick
        self.amplitude = zeros()
        """Alpha that each robot plays at now [count]."""
        self._left = zeros(len(self.home))
        self._draw(np.ones(count, bool), np.tile(self.home, (count, 1)))

    def reset(self, mask: np.ndarray, fell: np.ndarray) -> None:
        """The robots of the mask [count] begin anew with their arms at home; `fell` [count] tells why."""
        self._earn(mask & fell)
        self._draw(mask, np.tile(self.home, (int(mask.sum()), 1)))

    def step(self) -> np.ndarray:
        """Targets one tick later [count, 15], rad."""
        self._age += 1
        over = self._age >= self._ticks
        if over.any():
            before = self.at(0.0)[over]
            self._earn(over)
            self._draw(over, before)
        return self.at(0.0)

    def at(self, ahead: float) -> np.ndarray:
        """Targets `ahead` seconds from now, within the present play [count, 15], rad."""
        age = np.minimum(self._age + round(ahead / self._dt), self._ticks - 1)
        s = np.minimum(age * self._dt / BLEND, 1)[:, None]
        fading = 1 - (10 * s**3 - 15 * s**4 + 6 * s**5)
        return self._played(age) + fading * self._left

    def twist(self) -> np.ndarray:
        """How the person moved over the ground: forward and leftward velocity [m/s], yaw rate [rad/s] [count, 3]."""
        return self._twist[self._frame(self._age)]

    def height(self) -> np.ndarray:
        """The person's pelvis height at the robot's size [count], m."""
        return self._height[self._frame(self._age)]

    def _frame(self, age: np.ndarray) -> np.ndarray:
        return self._first + (age * self._pace).astype(int)

    def _played(self, age: np.ndarray) -> np.ndarray:
        low = self._frame(age)
        part = (age * self._pace % 1)[:, None]
        q = (1 - part) * self._q[low] + part * self._q[np.minimum(low + 1, self._last)]
        return self.home + self.amplitude[:, None] * (q - self.home)

    def _earn(self, ended: np.ndarray) -> None:
        if self.adaptive:
            stood = self._age[ended] >= SURVIVED * self._ticks[ended]
            np.add.at(self.alpha, self._clip[ended], np.where(stood, RISE, -FALL))
            np.clip(self.alpha, 0, 1, out=self.alpha)

    def _draw(self, mask: np.ndarray, before: np.ndarray) -> None:
        """New plays for the mask [count]; before: targets they leave [mask.sum(), 15]."""
        count = int(mask.sum())
        clip = self._rng.integers(len(self.alpha), size=count)
        pace = np.maximum(self._rng.uniform(2 - self._fastest, self._fastest, count), 1)
        ticks = np.minimum((self._length[clip] / pace).astype(int), round(LONGEST / self._dt))
        self._clip[mask], self._ticks[mask], self._age[mask], self._pace[mask] = clip, ticks, 0, pace
        self._first[mask] = self._start[clip] + self._rng.integers(self._length[clip] - (ticks * pace).astype(int) + 1)
        self._last[mask] = self._start[clip] + self._length[clip] - 1
        self.amplitude[mask] = self.alpha[clip]
        self._left[mask] = before - self._played(self._age)[mask]
