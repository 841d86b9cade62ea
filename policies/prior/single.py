"""R and D for one robot without torch: for the loop, and for the process that draws what the prior expects."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from policies import checkpoint
from policies.observation import LATENT, Mirror, joint_mirror
from policies.prior.history import WINDOW
from policies.single import SingleMLP
from robots.spec import RobotSpec

KIND = "prior"
"""Of the card beside the weights."""
_HALF = np.float32(0.5**0.5)


class Single:
    """The steps of `policies.prior.model.PriorModel`, z being the mean of R."""

    def __init__(self, mirror: Mirror, weights: Mapping[str, np.ndarray]) -> None:
        """mirror: of waist and arms; weights: by name, as they are stored."""
        basis, self._split = mirror.parity()
        self._basis = basis.astype(np.float32)
        self._mean, self._scale = weights["pose_mean"], weights["pose_scale"]
        self._past, self._past_scale = weights["past.basis"], weights["past.scale"]
        self._future, self._future_scale = np.ascontiguousarray(weights["future.basis"].T), weights["future.scale"]
        self._r, self._d = SingleMLP(weights, "r"), SingleMLP(weights, "d")

    @staticmethod
    def load(name: str, spec: RobotSpec) -> Single:
        """As `Prior.load`, with its errors."""
        weights, _ = checkpoint.load_arrays(checkpoint.find(name, KIND), expected(spec))
        return Single(joint_mirror(spec, spec.group("waist", "arms")), weights)

    def encode(self, history: np.ndarray) -> np.ndarray:
        """z [64] from the last second of targets [50, 15]."""
        return self._prior(*self._see(history))

    def predict(self, history: np.ndarray) -> np.ndarray:
        """The next second [50, 15], decoded from the mean of R."""
        even, odd = self._see(history)
        z, half = self._prior(even, odd), LATENT // 2
        left, right = z[:half], z[half:]
        even, odd = self._d(np.concatenate([_HALF * (left + right), even]), np.concatenate([_HALF * (left - right), odd]))
        curves = len(self._future_scale)
        coordinates = np.concatenate([even.reshape(curves, -1), odd.reshape(curves, -1)], 1)
        return history[-1] + self._future @ (coordinates * self._future_scale) @ self._basis

    def _see(self, history: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Even and odd channels of what the networks know of M0."""
        history = history.astype(np.float32, copy=False) @ self._basis.T
        last = history[-1]
        seen = np.concatenate([((last - self._mean) / self._scale)[None], (self._past @ (history - last)) / self._past_scale])
        return seen[:, : self._split].ravel(), seen[:, self._split :].ravel()

    def _prior(self, even: np.ndarray, odd: np.ndarray) -> np.ndarray:
        """The mean of R [64]: an even and an odd half, to halves that swap in the mirror."""
        (even, odd), half = self._r(even, odd), LATENT // 2
        return _HALF * np.concatenate([even[:half] + odd[:half], even[:half] - odd[:half]])


def expected(spec: RobotSpec) -> dict[str, object]:
    """What the card of a robot's prior must say."""
    joints = list(spec.motor_names[spec.group("waist", "arms")])
    return {"kind": KIND, "robot": spec.name, "joints": joints, "window": WINDOW}
