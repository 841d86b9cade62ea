"""Robots by name. A robot is a folder beside this file that exposes `ROBOT`; nothing else needs to know of it."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import mujoco

from robots.errors import UnknownRobot
from robots.spec import RobotSpec

Variant = Literal["training", "play"]


@dataclass(frozen=True)
class Robot:
    """A robot's numbers and the builder of its MuJoCo model."""

    spec: RobotSpec
    build: Callable[[Variant], mujoco.MjSpec]
    """training: hands and neck welded with their mass kept. play: everything moves, meshes if installed.
    Either has a key frame "home" and MuJoCo's silent reset after a divergence switched off."""
    missing: Callable[[], list[str]] = list
    """One sentence for each mesh package that is not installed; empty when the robot looks as it should."""

    def model(self, variant: Variant) -> mujoco.MjModel:
        """Compile one variant."""
        return self.build(variant).compile()


def known() -> list[str]:
    """Names that `load` takes."""
    return sorted(m.name for m in pkgutil.iter_modules([str(Path(__file__).parent)]) if m.ispkg)


def load(name: str) -> Robot:
    """The robot of that name.

    Raises:
        UnknownRobot: no folder of that name; the message lists the known ones.
    """
    if name not in known():
        raise UnknownRobot(name, known())
    return importlib.import_module(f"robots.{name}").ROBOT
