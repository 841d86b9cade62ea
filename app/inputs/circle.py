"""An example of a source: the right wrist goes round in a circle."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from app.arbiter import Role
from app.protocol import OperatorMessage, Pose, Wrists
from policies.command import Command

RADIUS = 0.06
"""Of the circle, in the plane across the robot [m]."""
PERIOD = 4.0
"""Of a round [s]."""


class Circle:
    """Drives the arms: starts where the wrist is."""

    name = "circle"

    def __init__(self, argument: str = "") -> None:
        """It needs no argument."""
        self._start: np.ndarray | None = None

    def message(self, seq: int, seconds: float, applied: Command, taken: Collection[Role]) -> OperatorMessage:
        """See app.inputs.source.Source."""
        start = self._start = applied.wrists[1].copy() if self._start is None else self._start
        angle = 2 * np.pi * seconds / PERIOD
        position = start[:3] + RADIUS * np.array([0.0, np.sin(angle), 1 - np.cos(angle)])
        pose = Pose(position=tuple(position.tolist()), quaternion=tuple(start[3:].tolist()))
        return OperatorMessage(seq=seq, roles=["arms"], engage=seq > 0, wrists=Wrists(right=pose))
