"""When an arm leaves its target for a moment to come back to it in another posture."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from policies.scout import Scout

LOST = (0.015, 0.1)
"""Errors that are worth a detour [m, rad]."""
CLOSING, CLOSING_HELD = 0.02, 0.1
"""An arm whose error falls by this share in a tick needs no help; the second, if a limit or its body holds it back."""
PATIENCE = 3
"""Ticks that an arm must be stuck before it looks for another posture."""
SAME = (0.01, 0.05)
"""A target that moves by less is the same target [m, rad]. A hand that is being led never makes detours."""
THERE = 0.04
"""A posture is taken when every joint is this near [rad]."""
TIMEOUT = 75
"""Ticks after which a swing that did not arrive is given up."""


class Detour:
    """Watches one arm. At most one detour a target."""

    def __init__(self, scout: Scout, arm: int) -> None:
        self._scout, self._arm = scout, arm
        self.forget(np.zeros(7))

    def forget(self, target: np.ndarray) -> None:
        """A new target [7]: nothing has been tried for it."""
        self._target, self._stuck, self._age = target.copy(), 0, 0
        self._search: Iterator[np.ndarray | None] | None = None
        self._tried = False
        self.posture: np.ndarray | None = None
        """The posture [n] to swing to now, None to follow the target."""

    def update(self, target: np.ndarray, q: np.ndarray, gap: Sequence[float], before: Sequence[float], held: bool) -> None:
        """One tick: joint targets q [n], the arm's distance and angle to its target [7] now and a tick ago, whether it is held back."""
        if _apart(target, self._target):
            self.forget(target)
        if self.posture is not None:
            self._age += 1
            if np.abs(q - self.posture)[self._scout.joints[self._arm]].max() < THERE or self._age > TIMEOUT:
                self.posture = None
        elif self._search is not None:
            self._look()
        elif not self._tried:
            lost = gap[0] > LOST[0] or gap[1] > LOST[1]
            least = CLOSING_HELD if held else CLOSING
            closing = any(now < (1 - least) * then for now, then in zip(gap, before, strict=True))
            self._stuck = self._stuck + 1 if lost and not closing else 0
            if self._stuck > PATIENCE:
                self._tried, self._search = True, self._scout.search(self._arm, self._target, q)

    def _look(self) -> None:
        """Let the scout think for a tick."""
        assert self._search is not None
        try:
            self.posture = next(self._search)
        except StopIteration:
            self._search = None
        if self.posture is not None:
            self._search, self._age = None, 0


def _apart(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two poses [7] are different targets."""
    cosine = min(abs(float(one[3:].dot(other[3:]))), 1.0)
    return math.dist(one[:3], other[:3]) > SAME[0] or 2 * math.acos(cosine) > SAME[1]
