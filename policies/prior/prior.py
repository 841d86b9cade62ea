"""The prior at run time: a second of upper-body targets in, 64 numbers out; and what it expects the arms to do, for the picture."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from policies import checkpoint
from policies.observation import LATENT
from policies.prior.model import WINDOW, PriorModel, Shape
from robots.spec import RobotSpec

_HALF = np.float32(0.5**0.5)
KIND = "prior"
"""Of the card beside the weights."""


class Prior:
    """A trained prior of one robot. Motions are waist and arm targets at the policy rate in motor order, rad, oldest first."""

    def __init__(self, model: PriorModel, card: dict) -> None:
        self.model, self.card = model.eval().requires_grad_(False), card
        self._single = _Single(model)

    @staticmethod
    def load(name: str, spec: RobotSpec) -> Prior:
        """The prior of a shipped name or of a path to a .safetensors file.

        Raises:
            UnknownPolicy: neither exists.
            WrongWeights: it was trained for another robot, or is no prior.
            DamagedWeights: the file or its card cannot be read.
        """
        joints = list(spec.motor_names[spec.group("waist", "arms")])
        path = checkpoint.find(name, KIND)
        tensors, card = checkpoint.load(path, {"kind": KIND, "robot": spec.name, "joints": joints, "window": WINDOW})
        model = PriorModel(spec, Shape.read(card["shape"]))
        model.load_state_dict(tensors)
        return Prior(model, card)

    @torch.no_grad()
    def encode(self, history: np.ndarray) -> np.ndarray:
        """The latent z [.., 64], the mean of R, for the last second of targets [.., 50, 15]. One robot [50, 15] takes a fast path."""
        if history.ndim == 2:
            return self._single.encode(history)
        return self.model.prior(self.model.see(_tensor(history))).mean.numpy()

    @torch.no_grad()
    def predict(self, history: np.ndarray) -> np.ndarray:
        """What the arms will do in the next second [.., 50, 15], decoded from the mean of R."""
        past = _tensor(history)
        seen = self.model.see(past)
        return self.model.decoder(self.model.prior(seen).mean, seen, past).numpy()


class _Single:
    """R for one robot in plain numpy: torch's overhead a call would be several times the arithmetic.

    The steps are those of `PriorModel.see`, `MirrorMLP` and the mean of R.
    """

    def __init__(self, model: PriorModel) -> None:
        self._parity, self._split = model.parity.basis.numpy().T, model.parity.even
        self._mean, self._scale = model.pose_mean.numpy(), model.pose_scale.numpy()
        self._basis, self._spread = model.past.basis.numpy(), model.past.scale.numpy()
        weights = {name: tensor.detach().numpy() for name, tensor in model.r.state_dict().items()}
        count = len(model.shape.prior_hidden) + 1
        self._layers = [(weights[f"evens.{i}.weight"], weights[f"evens.{i}.bias"], weights[f"odds.{i}.weight"]) for i in range(count)]

    def encode(self, history: np.ndarray) -> np.ndarray:
        """z [64] from one history [50, 15]."""
        history = history.astype(np.float32, copy=False) @ self._parity
        last = history[-1]
        seen = np.concatenate([((last - self._mean) / self._scale)[None], (self._basis @ (history - last)) / self._spread])
        even, odd = seen[:, : self._split].ravel(), seen[:, self._split :].ravel()
        for i, (weight, bias, odd_weight) in enumerate(self._layers):
            if i:
                left, right = _elu(_HALF * (even + odd)), _elu(_HALF * (even - odd))
                even, odd = _HALF * (left + right), _HALF * (left - right)
            even, odd = weight @ even + bias, odd_weight @ odd
        half = LATENT // 2
        return _HALF * np.concatenate([even[:half] + odd[:half], even[:half] - odd[:half]])


def _elu(x: np.ndarray) -> np.ndarray:
    return np.where(x > 0, x, np.expm1(np.minimum(x, 0)))


def _tensor(history: np.ndarray) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(history, dtype=np.float32))
