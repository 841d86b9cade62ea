"""`teleop-train`: teach the robot, from people's motion to its legs.

examples, in order:
  teleop-train retarget --clips motions/ --out runs/clips.npz      your BVH files become the robot's motions
  teleop-train synthetic --out runs/synthetic.npz                  made-up teleoperation, no files needed
  teleop-train prior --clips runs/clips.npz --synthetic runs/synthetic.npz
  teleop-train walk --run runs/walk                                legs; the other trainings need no legs
  teleop-train mean --weights runs/walk/walk.safetensors runs/more/walk.safetensors
  teleop-train curves --run runs/walk --out walk.png

A training or a retargeting that was stopped goes on when it is given again.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_WAIT_POLICY", "passive")  # the learner's idle threads must not spin beside the physics

import sys
from collections.abc import Sequence
from typing import Annotated

import tyro

from policies.errors import PolicyError
from policies.motion.folder import RetargetConfig, retarget
from policies.motion.synthetic import SyntheticConfig, synthesize
from policies.ppo.config import WalkConfig
from policies.ppo.curves import CurvesConfig, draw
from policies.ppo.mean import MeanConfig, mean
from policies.ppo.train import train
from policies.prior import train as prior
from robots.errors import RobotError

Task = (
    Annotated[RetargetConfig, tyro.conf.subcommand("retarget")]
    | Annotated[SyntheticConfig, tyro.conf.subcommand("synthetic")]
    | Annotated[prior.PriorConfig, tyro.conf.subcommand("prior")]
    | Annotated[WalkConfig, tyro.conf.subcommand("walk")]
    | Annotated[MeanConfig, tyro.conf.subcommand("mean")]
    | Annotated[CurvesConfig, tyro.conf.subcommand("curves")]
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line of the trainers."""
    config = tyro.cli(Task, prog="teleop-train", description=__doc__, args=arguments)
    try:
        match config:
            case RetargetConfig():
                retarget(config)
            case SyntheticConfig():
                synthesize(config)
            case prior.PriorConfig():
                print(f"weights: {prior.train(config)}")
            case WalkConfig():
                print(f"weights: {train(config)}")
            case MeanConfig():
                print(f"weights: {mean(config)}")
            case CurvesConfig():
                print(draw(config))
    except (PolicyError, RobotError) as error:
        sys.exit(f"teleop-train: {error}")
    except KeyboardInterrupt:
        sys.exit(130)
