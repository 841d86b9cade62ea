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
PATIENCE, QUIET = 3, 8
"""Ticks that an arm must be stuck, and its target must have stood still, before it looks for another posture: a hand that is
being led makes no detours."""
STILL, SAME = (0.004, 0.02), (0.05, 0.25)
"""A target that moves by less stands still; one that moves by less is the one for which a posture was sought [m, rad]."""
THERE = 0.04
"""A posture is taken when every joint is this near [rad]."""
TIMEOUT = 75
"""Ticks after which a swing that did not arrive is given up."""


class Detour:
    """Watches one arm. At most one detour a target."""

    def __init__(self, scout: Scout, arm: int) -> None:
        self._scout, self._arm = scout, arm
        self.reset([0.0] * 7)

    def reset(self, target: list[float]) -> None:
        """Stand at a target [7] for which nothing has been tried."""
        self._target, self._quiet, self._stuck, self._age = target, 0, 0, 0
        self._tried: list[float] | None = None
        self._search: Iterator[np.ndarray | None] | None = None
        self.posture: np.ndarray | None = None
        """The posture [n] to swing to now, None to follow the target."""

    def update(self, target: list[float], q: np.ndarray, gap: Sequence[float], before: Sequence[float], held: bool) -> None:
        """One tick: joint targets q [n], the arm's distance and angle to its target [7] now and a tick ago, whether it is held back."""
        if _apart(target, self._target, STILL):
            if self._search is not None:
                self._search = self._tried = None  # not thought through: it may be sought again
            self._target, self._quiet, self._stuck = target, 0, 0
        self._quiet += 1
        if self._tried is not None and _apart(target, self._tried, SAME):
            self._tried = self.posture = None
        if self.posture is not None:
            self._age += 1
            if np.abs(q - self.posture)[self._scout.joints[self._arm]].max() < THERE or self._age > TIMEOUT:
                self.posture = None
        elif self._search is not None:
            self._look()
        elif self._tried is None and self._quiet > QUIET and self._is_stuck(gap, before, held):
            self._tried, self._search = target, self._scout.search(self._arm, np.array(target), q)

    def _is_stuck(self, gap: Sequence[float], before: Sequence[float], held: bool) -> bool:
        """Whether the arm is off its target and has not come nearer for some ticks."""
        least = CLOSING_HELD if held else CLOSING
        lost = any(now > worth for now, worth in zip(gap, LOST, strict=True))
        closing = any(now < (1 - least) * then for now, then in zip(gap, before, strict=True))
        self._stuck = self._stuck + 1 if lost and not closing else 0
        return self._stuck > PATIENCE

    def _look(self) -> None:
        """Let the scout think for a tick."""
        assert self._search is not None
        try:
            self.posture = next(self._search)
        except StopIteration:
            self._search = None
        if self.posture is not None:
            self._search, self._age = None, 0


def _apart(one: list[float], other: list[float], least: tuple[float, float]) -> bool:
    """Whether two poses [7] differ by more than a distance [m] or an angle [rad]."""
    if one == other:
        return False
    cosine = min(abs(sum(a * b for a, b in zip(one[3:], other[3:], strict=True))), 1.0)
    return math.dist(one[:3], other[:3]) > least[0] or 2 * math.acos(cosine) > least[1]
