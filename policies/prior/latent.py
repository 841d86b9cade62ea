"""z of many robots, tick by tick, from the targets of their arms: one code path for training, benches and the live robot."""

from __future__ import annotations

import numpy as np

from policies.observation import LATENT
from policies.prior.history import History
from policies.prior.prior import Prior
from robots.spec import RobotSpec


class Latent:
    """The last second of upper-body targets, seen by the prior. Without a prior z is 0."""

    def __init__(self, spec: RobotSpec, prior: Prior | None, count: int = 1) -> None:
        home = spec.home[spec.group("waist", "arms")]
        self._prior, self._history = prior, History(count, len(home))
        self._zeros = np.zeros((count, LATENT), np.float32)
        self.reset(np.ones(count, bool), np.tile(home, (count, 1)))

    def reset(self, mask: np.ndarray, q: np.ndarray) -> None:
        """Robots of the mask [count] have held the targets q [count, 15] for ever, rad."""
        self._history.reset(mask, q)

    def step(self, q: np.ndarray) -> np.ndarray:
        """z [count, 64] once the arms are told to go to q [count, 15], rad."""
        past = self._history.push(q)
        if self._prior is None:
            return self._zeros
        return self._prior.encode(past[0])[None] if len(past) == 1 else self._prior.encode(past)
