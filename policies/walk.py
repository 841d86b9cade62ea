"""The legs at run time: the trained policy behind the same observation and gait clock as in training."""

from __future__ import annotations

import numpy as np
import torch

from policies import checkpoint
from policies.gait import Gait
from policies.networks import Actor
from policies.observation import LATENT, Mirror, Observer, action_mirror, layout, leg_targets
from policies.stance import Stance
from robots.catalog import Robot
from robots.state import State


class Walk:
    """Velocity and posture commands -> leg joint targets, for `count` robots at once; deterministic."""

    def __init__(self, robot: Robot, name: str, count: int = 1) -> None:
        """Load shipped weights by name, or a .safetensors file.

        Raises:
            UnknownPolicy, WrongWeights, DamagedWeights: see `policies.checkpoint`.
        """
        self._spec, self._count = robot.spec, count
        self.observer = Observer(robot.spec, count)
        self._stance = Stance(robot)
        self.gait = Gait(count, 1 / robot.spec.policy_rate)
        expect = {"kind": "walk", "robot": robot.spec.name, "observation": self.observer.size}
        tensors, self.card = checkpoint.load(checkpoint.find(name, "walk"), expect)
        self._actor = Actor(Mirror.stack(list(layout(robot.spec).values())), action_mirror(robot.spec))
        self._actor.load_state_dict(tensors)
        self._actor.eval()
        self.observation = np.zeros((count, self.observer.size), np.float32)
        """What the policy saw last [count, size]."""
        self.action = np.zeros((count, 12), np.float32)
        """What it answered [count, 12]."""

    def reset(self) -> None:
        """Forget the past; the robots stand."""
        everyone = np.ones(self._count, bool)
        self.gait.reset(everyone)
        self.observer.reset(everyone)
        self.action = np.zeros((self._count, 12), np.float32)

    @torch.inference_mode()
    def act(self, state: State, twist: np.ndarray, posture: np.ndarray, latent: np.ndarray | None = None) -> np.ndarray:
        """Leg joint targets [count, 12], rad.

        Args:
            twist: vx, vy [m/s], yaw rate [rad/s] in the heading frame [count, 3].
            posture: height [m], roll, pitch [rad] [count, 3].
            latent: the motion prior's z [count, 64]; None without a prior.
        """
        z = np.zeros((self._count, LATENT), np.float32) if latent is None else latent
        self.gait.step(state, twist)
        stance = self._stance(posture)
        self.observation = self.observer.observe(state, self.gait, twist, posture, stance, self.action, z)
        self.action = self._actor(torch.from_numpy(self.observation)).numpy()
        return leg_targets(self._spec, stance, self.action)
