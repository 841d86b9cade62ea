"""What an operator asks of the robot, whichever device it came from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

COMMAND_LAYOUT: Mapping[str, tuple[int, int]] = {
    "engage": (0, 1),
    "twist": (1, 4),
    "height": (4, 5),
    "roll": (5, 6),
    "pitch": (6, 7),
    "wrists": (7, 21),
    "hands": (21, 33),
    "neck": (33, 35),
    "waist": (35, 36),
}
"""Field of `Command` -> (start, stop) in its vector, kept in every recording so that a reader needs no source code."""
AT = {field: slice(*place) for field, place in COMMAND_LAYOUT.items()}
"""The same as slices."""
SIZE = 36
"""Numbers in a command's vector."""


def _forearms_ahead() -> np.ndarray:
    return np.array([[0.22, 0.29, 0.0, 0.978, 0.071, 0.195, 0.029], [0.22, -0.29, 0.0, 0.978, -0.071, 0.195, -0.029]])


@dataclass(frozen=True)
class Command:
    """One command. Policies own it; every input makes it, the guard passes it on, the recording keeps it."""

    engage: bool = False
    """The operator holds the enable."""
    twist: np.ndarray = field(default_factory=lambda: np.zeros(3))
    """Forward velocity, leftward velocity [m/s] and yaw rate [rad/s] in the heading frame [3]."""
    height: float = 1.0
    """Pelvis height above the floor [m]."""
    roll: float = 0.0
    """Lean of the pelvis to its right [rad]."""
    pitch: float = 0.0
    """Lean of the pelvis forward [rad]."""
    wrists: np.ndarray = field(default_factory=_forearms_ahead)
    """Left and right wrist: position [m] and quaternion wxyz in the pelvis frame [2, 7]."""
    hands: np.ndarray = field(default_factory=lambda: np.zeros((2, 6)))
    """Left and right hand: thumb yaw, thumb pitch, index, middle, ring, pinky; 0 open, 1 closed [2, 6]."""
    neck: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.3]))
    """Neck yaw and pitch [2], rad."""
    waist: float = 0.0
    """Waist yaw [rad]."""

    def vector(self) -> np.ndarray:
        """All numbers as float64 [SIZE]: for shared memory, recordings and finite-checks."""
        scalars = (self.height, self.roll, self.pitch)
        return np.concatenate([[float(self.engage)], self.twist, scalars, self.wrists.ravel(), self.hands.ravel(), self.neck, [self.waist]])

    @property
    def posture(self) -> np.ndarray:
        """Height [m], roll and pitch [rad] [3]."""
        return np.array([self.height, self.roll, self.pitch])

    @staticmethod
    def from_vector(row: np.ndarray) -> Command:
        """The command whose `vector` is row [SIZE]."""
        if row.shape != (SIZE,):
            raise ValueError(f"a command has {SIZE} numbers, not an array of shape {row.shape}")
        row = np.array(row, dtype=float)
        engage, height, roll, pitch, waist = (row[AT[field]].item() for field in ("engage", "height", "roll", "pitch", "waist"))
        return Command(
            engage=engage > 0.5,
            twist=row[AT["twist"]],
            height=height,
            roll=roll,
            pitch=pitch,
            wrists=row[AT["wrists"]].reshape(2, 7),
            hands=row[AT["hands"]].reshape(2, 6),
            neck=row[AT["neck"]],
            waist=waist,
        )

    def still(self) -> Command:
        """The same posture with no velocity asked for."""
        return replace(self, twist=np.zeros(3))
