"""The 1€ filter for one wrist: smooths a hand that rests, hardly delays one that moves.

G. Casiez, N. Roussel, D. Vogel: "1€ Filter: A Simple Speed-based Low-pass Filter for Noisy Input in Interactive Systems", CHI 2012.
"""

from __future__ import annotations

import mujoco
import numpy as np

CUTOFF = 2.0
"""Of a hand at rest [Hz]."""
PER_SPEED, PER_TURN = 12.0, 3.0
"""How much the cutoff grows with the speed [Hz s/m] and with the rate of turning [Hz s/rad]."""
SPEED_CUTOFF = 1.0
"""Of the low-pass of the speed itself [Hz]."""


class OneEuro:
    """Keeps one smoothed pose: position [m] and quaternion wxyz [7]."""

    def __init__(self, pose: np.ndarray, dt: float) -> None:
        """Start at rest in a pose [7]; dt: seconds between two calls of `step`."""
        self._pose, self._seen, self._dt = pose.copy(), pose.copy(), dt
        self._velocity, self._spin = np.zeros(3), np.zeros(3)
        self.delay = 0.0
        """How far the smoothed position lags behind at the newest speed [s]."""

    def step(self, pose: np.ndarray) -> np.ndarray:
        """The smoothed pose [7] after one more measured one [7]."""
        blend = self._share(SPEED_CUTOFF)
        self._velocity += blend * ((pose[:3] - self._seen[:3]) / self._dt - self._velocity)
        self._spin += blend * (turn_between(self._seen[3:], pose[3:]) / self._dt - self._spin)
        self._seen = pose.copy()
        share = self._share(CUTOFF + PER_SPEED * float(np.linalg.norm(self._velocity)))
        turn_share = self._share(CUTOFF + PER_TURN * float(np.linalg.norm(self._spin)))
        self.delay = (1 - share) / share * self._dt
        position = self._pose[:3] + share * (pose[:3] - self._pose[:3])
        quaternion = self._pose[3:].copy()
        mujoco.mju_quatIntegrate(quaternion, turn_between(quaternion, pose[3:]), turn_share)
        self._pose = np.concatenate([position, quaternion / np.linalg.norm(quaternion)])
        return self._pose

    def _share(self, cutoff: float) -> float:
        """Of the way to a new value that a first-order low-pass goes in one step."""
        return 1 / (1 + 1 / (2 * np.pi * cutoff * self._dt))


def turn_between(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """The rotation vector from one quaternion to the other, the short way [3], rad."""
    turn = np.empty(3)
    mujoco.mju_subQuat(turn, end, start)
    return turn
