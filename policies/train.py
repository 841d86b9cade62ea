"""`teleop-train`: teach the robot. `walk` trains the legs."""

from __future__ import annotations

import os

os.environ.setdefault("OMP_WAIT_POLICY", "passive")  # the learner's idle threads must not spin beside the physics

import tyro

from policies.ppo.train import WalkConfig, train


def main() -> None:
    """Command line of the trainers."""
    config = tyro.cli(WalkConfig, prog="teleop-train walk")
    print(f"weights: {train(config)}")
