"""`teleop-bench walk`: does the robot stay on its feet and go where it is told while its arms reach about and it is pushed?"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from policies.commit import commit
from policies.feedforward import Feedforward
from policies.motion.reaches import Reaches
from policies.walk import Walk
from robots import catalog
from robots.batch import Fleet
from robots.catalog import Robot

COMMANDS = {"stand": (0.0, 0.0, 0.0), "forward": (0.5, 0.0, 0.0), "sideways": (0.0, 0.3, 0.0), "turn": (0.0, 0.0, 0.5)}
"""m/s, m/s, rad/s"""
SETTLE = 2.0
"""Errors are counted from then on [s]."""
LOWEST = 0.6
"""A robot whose pelvis is lower counts as fallen here, as when Unitree's legs were measured [m]."""


@dataclass(frozen=True)
class WalkBench:
    """Bench the legs: 64 robots, 20 s, arms reaching about, pushed every 5 s.

    Example: teleop-bench walk --push 0 0.5 1.0 1.5 --json walk.json
    """

    policy: str = "walk_h1"
    """Shipped weights by name, or a .safetensors file."""
    robot: str = "h1"
    """Name in the catalog."""
    push: tuple[float, ...] = (0.0, 0.5, 1.0, 1.5)
    """Velocity pushes, at 4 s and every 5 s, in random directions [m/s]."""
    alpha: float = 1.0
    """Amplitude of the arms' reaches."""
    robots: int = 64
    """Robots a row."""
    seconds: float = 20.0
    """Length of a rollout."""
    seed: int = 0
    """Of reaches and pushes."""
    json: Path | None = None
    """Also write the rows to this file."""


def run(config: WalkBench) -> dict:
    """Roll out every command at every push size; prints the table and returns the JSON record."""
    robot = catalog.load(config.robot)
    cases = [(command, push) for push in config.push for command in COMMANDS]
    rows = []
    with Progress(transient=True) as progress:
        task = progress.add_task("walking", total=len(cases))
        for command, push in cases:
            progress.update(task, description=f"{command}, push {push} m/s")
            rows.append(rollout(robot, config, command, push))
            progress.advance(task)
    record = {"rows": rows, "seed": config.seed, "commit": commit(), "policy": config.policy}
    Console(width=150).print(_table(rows))
    if config.json:
        config.json.write_text(json.dumps(record, indent=1) + "\n")
    return record


def rollout(robot: Robot, config: WalkBench, command: str, push: float) -> dict:
    """One row: `robots` robots for `seconds` on nominal physics without noise."""
    n, dt = config.robots, 1 / robot.spec.policy_rate
    rng = np.random.default_rng([config.seed, list(COMMANDS).index(command), round(100 * push)])
    fleet, walk, reaches = Fleet(robot, n), Walk(robot, config.policy, n), Reaches(robot.spec, n, dt, rng)
    arms = Feedforward(robot, n)
    reaches.amplitude[:] = config.alpha
    everyone = np.ones(n, bool)
    fleet.reset(everyone)
    reaches.reset(everyone)
    twist = np.tile(COMMANDS[command], (n, 1))
    posture = np.tile([robot.spec.nominal_height, 0.0, 0.0], (n, 1))
    legs = robot.spec.group("legs")
    state, upright, record = fleet.state(), everyone.copy(), []
    for tick in range(round(config.seconds / dt)):
        if push and tick * dt >= 4 and round((tick * dt - 4) / dt) % round(5 / dt) == 0:
            angle = rng.uniform(0, 2 * np.pi, n)
            fleet.qvel[:, 0] += push * np.cos(angle)
            fleet.qvel[:, 1] += push * np.sin(angle)
        before = state.dq[:, legs]
        upper = reaches.step()
        state = fleet.step(np.concatenate([walk.act(state, twist, posture, upper), arms.step(upper, state)], -1))
        upright &= ~state.fallen(LOWEST) & fleet.finite
        if tick * dt >= SETTLE:
            velocity = np.column_stack([state.heading_velocity, state.yaw_rate])
            miss = velocity[:, :2] - twist[:, :2]
            c, s = np.cos(state.yaw), np.sin(state.yaw)
            lost = np.column_stack([c * miss[:, 0] - s * miss[:, 1], s * miss[:, 0] + c * miss[:, 1]])
            tilt = np.linalg.norm(state.gravity[:, :2], axis=-1)
            acceleration = np.abs(state.dq[:, legs] - before).mean(-1) / dt
            record.append(np.column_stack([velocity, lost, tilt, (~state.contact).mean(-1), acceleration]))
    return {"command": command, "alpha": config.alpha, "push": push} | _metrics(np.array(record), upright, twist[0], dt)


def _metrics(record: np.ndarray, upright: np.ndarray, twist: np.ndarray, dt: float) -> dict:
    """Means over time and over the robots that stayed upright; record is [ticks, robots, 8]."""
    row: dict = {"upright": round(float(upright.mean()), 4)}
    if not upright.any():
        return row
    kept = record[:, upright]
    velocity = kept[:, :, :3]
    error = np.abs(velocity - twist)
    drift = np.linalg.norm(kept[:, :, 3:5].sum(0) * dt, axis=-1)
    values = {
        "velocity_error": error[:, :, :2].mean((0, 1)).tolist(),
        "yaw_rate_error": error[:, :, 2].mean(),
        "tilt": kept[:, :, 5].mean(),
        "air_time": kept[:, :, 6].mean(),
        "velocity": velocity.mean((0, 1)).tolist(),
        "drift": drift.mean(),
        "drift_max": drift.max(),
        "joint_acceleration": kept[:, :, 7].mean(),
    }
    return row | {k: [round(x, 4) for x in v] if isinstance(v, list) else round(float(v), 4) for k, v in values.items()}


def _table(rows: list[dict]) -> Table:
    table = Table(title="walking bench")
    for name in (
        "command",
        "push m/s",
        "upright",
        "error vx, vy m/s",
        "yaw rad/s",
        "tilt",
        "in the air",
        "velocity vx vy yaw",
        "drift m",
        "max",
        "acc rad/s2",
    ):
        table.add_column(name, justify="right")
    for r in rows:
        cells = [r["command"], f"{r['push']:.1f}", f"{100 * r['upright']:.0f} %"]
        if "tilt" in r:
            pair = "  ".join(f"{x:.3f}" for x in r["velocity_error"])
            went = " ".join(f"{x:+.2f}" for x in r["velocity"])
            cells += [pair, f"{r['yaw_rate_error']:.3f}", f"{r['tilt']:.3f}", f"{r['air_time']:.3f}", went]
            cells += [f"{r['drift']:.2f}", f"{r['drift_max']:.2f}", f"{r['joint_acceleration']:.1f}"]
        table.add_row(*cells)
    return table
