"""The last second of upper-body targets of every robot: the one way in which motions reach the prior, in training and at run time."""

from __future__ import annotations

import numpy as np

WINDOW = 50
"""Frames of the past that the prior sees, and of the future that it expects: one second on the H1."""


class History:
    """Targets of `count` robots, oldest first. Each row is written twice, so that the last second is always one slice."""

    def __init__(self, count: int, joints: int) -> None:
        self._rows = np.zeros((count, 2 * WINDOW, joints), np.float32)
        self._at = 0

    def reset(self, mask: np.ndarray, q: np.ndarray) -> None:
        """Robots of the mask [count] have held the targets q [count, joints] for ever, rad."""
        self._rows[mask] = q[mask, None]

    def push(self, q: np.ndarray) -> np.ndarray:
        """Add this tick's targets q [count, joints]; the last second, this tick included [count, 50, joints], valid until the next call."""
        self._rows[:, self._at] = self._rows[:, self._at + WINDOW] = q
        self._at = (self._at + 1) % WINDOW
        return self._rows[:, self._at : self._at + WINDOW]
