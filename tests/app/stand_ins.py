"""An H1 that hangs by its pelvis, and policies that hold it at home or misbehave: PD alone does not stand."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from app.failsafe import TracedPolicy
from policies.command import Command
from policies.errors import WrongWeights
from robots import catalog
from robots.plant import Plant
from robots.state import State
from robots.target import Target


class HangingPlant(Plant):
    """Its pelvis stays where it is."""

    def step(self, target: Target) -> State:
        pelvis = self.data.qpos[:7].copy()
        super().step(target)
        self.data.qpos[:7], self.data.qvel[:6] = pelvis, 0
        return self.state()

    def drop(self) -> None:
        """Lay the robot on its side."""
        self.data.qpos[3:7] = [np.sqrt(0.5), np.sqrt(0.5), 0, 0]


class AtHome:
    """Holds every motor at home; tells its trace."""

    def __init__(self, home: np.ndarray) -> None:
        self.home, self.resets, self.commands = home, 0, []
        reached = SimpleNamespace(q=home[12:27], reachable=np.tile([0.3, 0, 0, 1, 0, 0, 0], (2, 1)), reasons=("", "reach"))
        numbers = [np.full(n, n, np.float32) for n in (5, 4, 3)]
        self.trace = SimpleNamespace(
            observation=numbers[0], latent=numbers[1], action=numbers[2], reached=reached, ik_ms=0.1, policy_ms=0.2
        )

    def reset(self, state: State) -> None:
        self.resets += 1

    def choose(self, index: int) -> None:
        self.chosen = index

    def act(self, state: State, command: Command) -> Target:
        self.commands.append(command)
        return Target(self.home)


class Faulty(AtHome):
    """Does what the script says in each call: ok, nan, shape, raise, late; then ok."""

    def __init__(self, home: np.ndarray, script: list[str]) -> None:
        super().__init__(home)
        self.script = ["ok", *script]  # the first call warms up

    def act(self, state: State, command: Command) -> Target:
        super().act(state, command)
        what = self.script.pop(0) if self.script else "ok"
        if what == "raise":
            raise RuntimeError("on purpose")
        if what == "late":
            time.sleep(0.25)
        return Target({"nan": self.home * np.nan, "shape": self.home[:3]}.get(what, self.home + 0.01))


@dataclass(frozen=True)
class Hanging:
    """What a simulation process runs in tests."""

    script: tuple[str, ...] = field(default=())

    def __call__(self) -> tuple[Plant, TracedPolicy]:
        plant = HangingPlant(catalog.load("h1"))
        return plant, Faulty(plant.spec.home, list(self.script))


@dataclass(frozen=True)
class Broken:
    """A robot whose weights do not fit."""

    def __call__(self) -> tuple[Plant, TracedPolicy]:
        raise WrongWeights(Path("x.safetensors"), "robot", "gr1", "h1")


def eventually(holds: Callable[[], object], seconds: float = 10.0) -> None:
    """Wait until it holds; machines that run tests are busy.

    Raises:
        AssertionError: it does not in that time.
    """
    deadline = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < deadline, "it never came true"
        time.sleep(0.01)
