"""The legs at run time: the trained policy behind the same observation and gait clock as in training."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch

from policies import checkpoint
from policies.errors import DamagedWeights
from policies.gait import Gait
from policies.networks import Actor
from policies.observation import LATENT, Mirror, Observer, action_mirror, layout, leg_targets
from policies.prior.latent import Latent
from policies.prior.prior import Prior
from policies.single import SingleActor
from policies.stance import Stance
from robots.catalog import Robot
from robots.spec import RobotSpec
from robots.state import State


@dataclass(frozen=True)
class Learnt:
    """One set of leg weights."""

    actor: Callable[[np.ndarray], np.ndarray]
    """Observations [count, size] -> actions [count, 12]."""
    prior: str | None
    """Name of the motion prior whose z it sees."""
    card: dict

    @staticmethod
    def load(spec: RobotSpec, name: str, count: int = 1) -> Learnt:
        """Weights for `count` robots at once: shipped ones by name, or a .safetensors file.

        Raises:
            UnknownPolicy, WrongWeights, DamagedWeights: see `policies.checkpoint`.
        """
        mirrors = Mirror.stack(list(layout(spec).values())), action_mirror(spec)
        expect = {"kind": "walk", "robot": spec.name, "observation": len(mirrors[0].sign)}
        path = checkpoint.find(name, "walk")
        tensors, card = checkpoint.load(path, expect)
        if "prior" not in card:
            raise DamagedWeights(path, "its card does not name its prior, or null")
        actor = Actor(*mirrors)
        checkpoint.check(path, tensors, actor.state_dict())
        actor.load_state_dict(tensors)
        if count > 1:
            return Learnt(partial(_run, actor.eval()), card["prior"], card)
        single = SingleActor({name: tensor.numpy() for name, tensor in tensors.items()}, *mirrors)
        return Learnt(lambda observation: single(observation[0])[None], card["prior"], card)


class Walk:
    """Velocity and posture commands -> leg joint targets, for `count` robots at once; deterministic."""

    def __init__(self, robot: Robot, name: str, count: int = 1, others: Sequence[str] = ()) -> None:
        """Load shipped weights by name, or a .safetensors file, and others that `choose` changes to.

        Raises:
            UnknownPolicy, WrongWeights, DamagedWeights: see `policies.checkpoint`.
        """
        self._spec, self._count = robot.spec, count
        self.observer = Observer(robot.spec, count)
        self._stance = Stance(robot)
        self.gait = Gait(count, 1 / robot.spec.policy_rate)
        self._learnt = [Learnt.load(robot.spec, each, count) for each in (name, *others)]
        priors = {learnt.prior for learnt in self._learnt}
        self._latents = {prior: Latent(robot.spec, Prior.load(prior, robot.spec) if prior else None, count) for prior in priors}
        self.chosen = 0
        """Which of the weights is walking: 0 is `name`, then `others`."""
        self.latent = np.zeros((count, LATENT), np.float32)
        """The motion prior's z at the last tick [count, 64]; zeros without a prior."""
        self.observation = np.zeros((count, self.observer.size), np.float32)
        """What the policy saw last [count, size]."""
        self.action = np.zeros((count, 12), np.float32)
        """What it answered [count, 12]."""

    def reset(self, upper: np.ndarray, mask: np.ndarray | None = None) -> None:
        """Forget the past; the robots of the mask [count], or all, stand with waist and arms at upper [count, 15], rad."""
        mask = np.ones(self._count, bool) if mask is None else mask
        for latent in self._latents.values():
            latent.reset(mask, upper)
        self.gait.reset(mask)
        self.observer.reset(mask)
        self.action = np.where(mask[:, None], np.float32(0), self.action)

    @property
    def card(self) -> dict:
        """What the weights are that walk now."""
        return self._learnt[self.chosen].card

    def choose(self, index: int) -> None:
        """Let other weights walk from here on. All see the same past, so the change needs no pause."""
        if 0 <= index < len(self._learnt):
            self.chosen = index

    def act(self, state: State, twist: np.ndarray, posture: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """Leg joint targets [count, 12], rad.

        Args:
            twist: vx, vy [m/s], yaw rate [rad/s] in the heading frame [count, 3].
            posture: height [m], roll, pitch [rad] [count, 3].
            upper: where waist and arms are told to go in this tick [count, 15], rad; the prior makes z of the last second of them.
        """
        learnt = self._learnt[self.chosen]
        self.latent = {prior: latent.step(upper) for prior, latent in self._latents.items()}[learnt.prior]
        self.gait.step(state, twist)
        stance = self._stance(posture)
        self.observation = self.observer.observe(state, self.gait, twist, posture, stance, self.action, self.latent)
        self.action = learnt.actor(self.observation)
        return leg_targets(self._spec, stance, self.action)


@torch.inference_mode()
def _run(actor: Actor, observation: np.ndarray) -> np.ndarray:
    return actor(torch.from_numpy(observation)).numpy()
