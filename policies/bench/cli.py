"""`teleop-bench`: every figure of the README, as a command."""

from __future__ import annotations

import os

os.environ.setdefault("OMP_WAIT_POLICY", "passive")  # torch's idle threads must not spin beside the physics

import sys
from typing import Annotated

import tyro

from policies.bench import arms, drive, hands, latency, soak, speed, walk
from policies.errors import PolicyError
from robots.errors import RobotError

Bench = (
    Annotated[walk.WalkBench, tyro.conf.subcommand("walk")]
    | Annotated[speed.SpeedBench, tyro.conf.subcommand("speed")]
    | Annotated[drive.DriveBench, tyro.conf.subcommand("drive")]
    | Annotated[soak.SoakBench, tyro.conf.subcommand("soak")]
    | Annotated[arms.ArmsBench, tyro.conf.subcommand("arms")]
    | Annotated[latency.LatencyBench, tyro.conf.subcommand("latency")]
    | Annotated[hands.HandsBench, tyro.conf.subcommand("hands")]
)


def main() -> None:
    """Command line of the benches."""
    config = tyro.cli(Bench, prog="teleop-bench", description=__doc__)
    try:
        match config:
            case walk.WalkBench():
                walk.run(config)
            case speed.SpeedBench():
                speed.run(config)
            case drive.DriveBench():
                drive.run(config)
            case soak.SoakBench():
                soak.run(config)
            case arms.ArmsBench():
                arms.run(config)
            case latency.LatencyBench():
                latency.run(config)
            case hands.HandsBench():
                hands.run(config)
    except (PolicyError, RobotError) as error:
        sys.exit(f"teleop-bench: {error}")
    except KeyboardInterrupt:
        sys.exit(130)
