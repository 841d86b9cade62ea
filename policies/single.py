"""Networks for one robot in plain numpy: torch's overhead a call would be several times the arithmetic."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from policies.observation import Mirror

_HALF = np.float32(0.5**0.5)


class SingleMLP:
    """The steps of `policies.networks.MirrorMLP`."""

    def __init__(self, weights: Mapping[str, np.ndarray], name: str) -> None:
        """weights: by name, as they are stored; name: of the network among them."""
        count = sum(key.startswith(f"{name}.evens.") and key.endswith(".weight") for key in weights)
        keys = ("evens.{}.weight", "evens.{}.bias", "odds.{}.weight")
        self._layers = [tuple(weights[f"{name}.{key.format(i)}"] for key in keys) for i in range(count)]

    def __call__(self, even: np.ndarray, odd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Even and odd part of the output, from those of the input."""
        for i, (weight, bias, odd_weight) in enumerate(self._layers):
            if i:
                left, right = _elu(_HALF * (even + odd)), _elu(_HALF * (even - odd))
                even, odd = _HALF * (left + right), _HALF * (left - right)
            even, odd = weight @ even + bias, odd_weight @ odd
        return even, odd


class SingleActor:
    """The steps of `policies.networks.Actor`."""

    def __init__(self, weights: Mapping[str, np.ndarray], observation: Mirror, action: Mirror) -> None:
        """weights: by name, as they are stored; the mirrors are those of the actor."""
        basis, self._even = observation.parity()
        scale = 1 / (np.sqrt(np.maximum(weights["normaliser.variance"], 0)) + np.float32(0.01))
        self._basis = (basis * scale[:, None]).astype(np.float32)
        self._mean = weights["normaliser.mean"] * scale
        self._body = SingleMLP(weights, "body")
        self._out = np.ascontiguousarray(action.parity()[0].T, np.float32)

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """Mean action [12] from one observation [n]."""
        features = np.clip(self._basis @ observation - self._mean, -8, 8)
        return self._out @ np.concatenate(self._body(features[: self._even], features[self._even :]))


def _elu(x: np.ndarray) -> np.ndarray:
    return np.where(x > 0, x, np.expm1(np.minimum(x, 0)))
