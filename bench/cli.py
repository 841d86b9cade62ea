"""`teleop-bench`: every figure of the README, as a command."""

from __future__ import annotations

import os

os.environ.setdefault("OMP_WAIT_POLICY", "passive")  # torch's idle threads must not spin beside the physics

import sys
from typing import Annotated

import tyro

from bench import drive, latency, soak, speed
from policies.bench import arms, falls, hands, paper, prior, push, robustness, walk, wrists
from policies.errors import PolicyError
from policies.motion.errors import MotionError
from robots.errors import RobotError

Bench = (
    Annotated[walk.WalkBench, tyro.conf.subcommand("walk")]
    | Annotated[speed.SpeedBench, tyro.conf.subcommand("speed")]
    | Annotated[drive.DriveBench, tyro.conf.subcommand("drive")]
    | Annotated[soak.SoakBench, tyro.conf.subcommand("soak")]
    | Annotated[arms.ArmsBench, tyro.conf.subcommand("arms")]
    | Annotated[latency.LatencyBench, tyro.conf.subcommand("latency")]
    | Annotated[hands.HandsBench, tyro.conf.subcommand("hands")]
    | Annotated[prior.PriorBench, tyro.conf.subcommand("prior")]
    | Annotated[paper.PaperBench, tyro.conf.subcommand("paper")]
    | Annotated[robustness.RobustnessBench, tyro.conf.subcommand("robustness")]
    | Annotated[push.PushBench, tyro.conf.subcommand("push")]
    | Annotated[falls.FallsBench, tyro.conf.subcommand("falls")]
    | Annotated[wrists.WristsBench, tyro.conf.subcommand("wrists")]
)


def main() -> None:
    """Command line of the benches."""
    config = tyro.cli(Bench, prog="teleop-bench", description=__doc__)
    try:
        sys.modules[type(config).__module__].run(config)
    except (PolicyError, RobotError, MotionError) as error:
        sys.exit(f"teleop-bench: {error}")
    except KeyboardInterrupt:
        sys.exit(130)
