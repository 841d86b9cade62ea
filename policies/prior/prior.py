"""The prior at run time: a second of upper-body targets in, 64 numbers out; and what it expects the arms to do, for the picture."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from policies import checkpoint
from policies.errors import DamagedWeights
from policies.prior.model import PriorModel, Shape
from policies.prior.single import KIND, Single, expected
from robots.spec import RobotSpec


class Prior:
    """A trained prior of one robot. Motions are waist and arm targets at the policy rate in motor order, rad, oldest first."""

    def __init__(self, model: PriorModel, card: dict) -> None:
        self.model, self.card = model.eval().requires_grad_(False), card
        self._single = Single(model.mirror, {name: tensor.numpy() for name, tensor in model.state_dict().items()})

    @staticmethod
    def load(name: str, spec: RobotSpec) -> Prior:
        """The prior of a shipped name or of a path to a .safetensors file.

        Raises:
            UnknownPolicy: neither exists.
            WrongWeights: it was trained for another robot, or is no prior.
            DamagedWeights: the file or its card cannot be read.
        """
        path = checkpoint.find(name, KIND)
        tensors, card = checkpoint.load(path, expected(spec))
        try:
            model = PriorModel(spec, Shape.read(card["shape"]))
        except (KeyError, TypeError, AttributeError) as error:
            raise DamagedWeights(path, f"its card tells no sizes of networks: {error}") from error
        checkpoint.check(path, tensors, model.state_dict())
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
        """What the arms will do in the next second [.., 50, 15], decoded from the mean of R. One robot takes a fast path."""
        if history.ndim == 2:
            return self._single.predict(history)
        past = _tensor(history)
        seen = self.model.see(past)
        return self.model.decoder(self.model.prior(seen).mean, seen, past).numpy()


def _tensor(history: np.ndarray) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(history, dtype=np.float32))
