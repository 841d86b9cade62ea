"""`teleop-train`: teach the robot. `walk` trains the legs, `curves` draws how it went."""

from __future__ import annotations

import os

os.environ.setdefault("OMP_WAIT_POLICY", "passive")  # the learner's idle threads must not spin beside the physics

import sys
from typing import Annotated

import tyro

from policies.errors import PolicyError
from policies.ppo.curves import CurvesConfig, draw
from policies.ppo.train import WalkConfig, train
from robots.errors import RobotError

Task = Annotated[WalkConfig, tyro.conf.subcommand("walk")] | Annotated[CurvesConfig, tyro.conf.subcommand("curves")]


def main() -> None:
    """Command line of the trainers."""
    config = tyro.cli(Task, prog="teleop-train", description=__doc__)
    try:
        print(draw(config) if isinstance(config, CurvesConfig) else f"weights: {train(config)}")
    except (PolicyError, RobotError) as error:
        sys.exit(f"teleop-train: {error}")
