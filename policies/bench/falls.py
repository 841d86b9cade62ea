"""`teleop-bench falls`: hours of simulated driving with random commands while the arms play people's motions; falls an hour."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from policies import checkpoint
from policies.bench.motions import motions
from policies.bench.tracking import fallen
from policies.commit import commit
from policies.envelope import HEIGHT, TWIST, next_posture, next_twist
from policies.feedforward import Feedforward
from policies.motion.clip import ClipSet
from policies.motion.playback import Playback
from policies.walk import Walk
from robots import catalog
from robots.batch import Fleet
from robots.catalog import Robot

STAND = 0.25
"""Share of commands that ask to stand."""


@dataclass(frozen=True)
class FallsBench:
    """Drive many robots about at random for hours of robot time, as fast as the guard lets an operator; the aim is no fall at all.

    Example: teleop-bench falls --motions runs/clips.npz --hours 1
    """

    motions: Path | None = None
    """As in `teleop-bench paper`."""
    policy: tuple[str, ...] = ()
    """Shipped weights by name, or .safetensors files; none: all that are shipped."""
    hours: float = 1.0
    """Of all robots together."""
    robots: int = 64
    """Side by side."""
    robot: str = "h1"
    """Name in the catalog."""
    seed: int = 0
    """Of commands and of who plays what."""
    json: Path | None = None
    """Also write the figures to this file."""


def run(config: FallsBench) -> dict:
    """Drive, print the table, return the JSON record."""
    robot = catalog.load(config.robot)
    clips = motions(robot, config.motions)
    rows = [{"policy": policy} | drive(robot, policy, clips, config) for policy in config.policy or tuple(checkpoint.known("walk"))]
    record = {"rows": rows, "clips": len(clips), "hours": config.hours, "seed": config.seed, "commit": commit()}
    table = Table("policy", "falls", "falls a robot-hour", "walked km", title=f"{config.hours:g} robot-hours of random driving")
    for row in rows:
        table.add_row(checkpoint.title(row["policy"]), str(row["falls"]), f"{row['falls_per_hour']:.2f}", f"{row['kilometres']:.2f}")
    Console().print(table)
    if config.json:
        config.json.write_text(json.dumps(record, indent=1) + "\n")
    return record


def drive(robot: Robot, policy: str, clips: ClipSet, config: FallsBench) -> dict:
    """Robots that fall stand up again at home and go on; commands change as fast as the guard lets an operator's."""
    n, dt, rng = config.robots, 1 / robot.spec.policy_rate, np.random.default_rng(config.seed)
    fleet, walk, playback = Fleet(robot, n), Walk(robot, policy, n), Playback(robot.spec, clips, n, rng, alpha=1.0)
    arms = Feedforward(robot, n)
    playback.adaptive = False
    everyone = np.ones(n, bool)
    fleet.reset(everyone)
    home = np.array([robot.spec.nominal_height, 0, 0])
    goal, twist, posture, left = np.tile([0, 0, 0, *home], (n, 1)), np.zeros((n, 3)), np.tile(home, (n, 1)), np.zeros(n)
    low, high = np.column_stack([TWIST, HEIGHT])
    state, falls, metres = fleet.state(), 0, 0.0
    for _ in track(range(round(3600 * config.hours / n / dt)), f"driving {checkpoint.title(policy)}", transient=True):
        left -= dt
        new = left <= 0
        goal[new, :4] = rng.uniform(low, high, (int(new.sum()), 4))
        goal[new & (rng.random(n) < STAND), :3] = 0
        left[new] = rng.uniform(2, 8, int(new.sum()))
        twist, posture, upper = next_twist(twist, goal[:, :3], dt), next_posture(posture, goal[:, 3:], dt), playback.step()
        state = fleet.step(np.concatenate([walk.act(state, twist, posture, upper), arms.step(upper, state)], -1))
        metres += float(np.linalg.norm(state.velocity[:, :2], axis=-1).sum()) * dt
        down = fallen(state, fleet)
        if down.any():
            falls += int(down.sum())
            fleet.reset(down)
            arms.reset(down)
            playback.reset(down, down)
            walk.reset(np.tile(playback.home, (n, 1)), down)
            twist[down], posture[down], left[down] = 0, home, 0
            state = fleet.state()
    return {"falls": falls, "falls_per_hour": falls / config.hours, "kilometres": metres / 1000}
