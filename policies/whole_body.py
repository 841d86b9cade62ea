"""The whole robot: arms by inverse kinematics, hands and neck as told, legs by the trained policy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from policies.command import Command
from policies.feedforward import Feedforward
from policies.hand_model import drive_range
from policies.interpolator import Interpolator
from policies.observation import LATENT
from policies.reach import Reach, Reached
from policies.walk import Walk
from robots.catalog import Robot
from robots.state import State
from robots.target import Target


@dataclass(frozen=True)
class Trace:
    """The inside of one `act`, for the page and the recording."""

    observation: np.ndarray
    """What the leg policy saw [274], float32."""
    latent: np.ndarray
    """The motion prior's z [64], float32; zeros without a prior."""
    action: np.ndarray
    """What the leg policy answered [12], float32."""
    reached: Reached
    """What the arms do about the wrist targets."""
    ik_ms: float
    """Time of the inverse kinematics [ms]."""
    policy_ms: float
    """Time of everything else [ms]."""


class WholeBody:
    """Composes reach, hands and walk by joint group."""

    def __init__(self, robot: Robot, walk: str, others: Sequence[str] = ()) -> None:
        """walk: shipped leg weights by name, or a .safetensors file; others: those that `choose` changes to.

        Raises:
            UnknownPolicy, WrongWeights, DamagedWeights: see `policies.checkpoint`.
        """
        self._spec = spec = robot.spec
        self._reach = Reach(robot, dt=1 / spec.policy_rate)
        self._interpolator = Interpolator(self._reach.forward(spec.home[spec.group("waist", "arms")]), 1 / spec.policy_rate)
        self._feedforward = Feedforward(robot)
        self._walk = Walk(robot, walk, others=others)
        self._upper, self._hands, self._neck = spec.group("waist", "arms"), spec.group("hands"), spec.group("neck")
        self._open, self._closed = drive_range(spec)
        self.trace = Trace(
            np.zeros(self._walk.observer.size, np.float32), np.zeros(LATENT, np.float32), np.zeros(12, np.float32),
            self._reach.solve(self._reach.forward(spec.home[self._upper])), 0.0, 0.0,
        )  # fmt: skip

    def choose(self, index: int) -> None:
        """Walk with other weights from here on: 0 is `walk`, then `others`."""
        self._walk.choose(index)

    def reset(self, state: State) -> None:
        """Forget the past; the arms start from where they are."""
        self._reach.reset(state.q[self._upper])
        self._interpolator.reset(self._reach.forward(state.q[self._upper]))
        self._feedforward.reset()
        self._walk.reset(state.q[None, self._upper])

    def act(self, state: State, command: Command) -> Target:
        """Targets of all motors [41]."""
        began = perf_counter()
        reached = self._reach.solve(self._interpolator.step(command.wrists), command.waist)
        solved = perf_counter()
        spec, q, alone = self._spec, self._spec.home.copy(), _alone(state)
        q[self._upper] = self._feedforward.step(reached.q[None], alone)[0]
        q[self._hands] = self._open + command.hands.ravel() * (self._closed - self._open)
        q[self._neck] = command.neck
        posture = np.array([[command.height, command.roll, command.pitch]])
        q[spec.group("legs")] = self._walk.act(alone, command.twist[None], posture, reached.q[None])[0]
        done = perf_counter()
        self.trace = Trace(
            self._walk.observation[0],
            self._walk.latent[0],
            self._walk.action[0],
            reached,
            1e3 * (solved - began),
            1e3 * (done - solved),
        )
        return Target(np.clip(q, spec.lower, spec.upper))


def _alone(state: State) -> State:
    """The state of one robot as a batch of one."""
    return State(**{name: np.asarray(value)[None] for name, value in vars(state).items()})
