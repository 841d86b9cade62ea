"""`teleop-bench push`: how far a push on the torso tips the robot, and how soon it is over; the paper's push table."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from policies import checkpoint
from policies.bench.tracking import fallen
from policies.commit import commit
from policies.feedforward import Feedforward
from policies.gait import PERIOD
from policies.picture import canvas
from policies.walk import Walk
from robots import catalog
from robots.batch import Fleet
from robots.catalog import Robot

PAPER = {
    "paper: PMP": {"walking": (0.253, -0.152, 0.035, 0.59), "standing": (0.241, -0.150, 0.029, 4.46)},
    "paper: w/o prior": {"walking": (0.296, -0.138, 0.050, 0.66), "standing": (0.331, -0.161, 0.051, 5.38)},
}
"""Largest pitch rate [rad/s], lowest and highest pitch [rad], recovery [s] of the real H1; how hard it was pushed is not told."""
BEFORE, AFTER = 5.0, 8.0
"""Time before the push, and how long is watched after it [s]."""
STILL = {"pitch": 0.02, "rate": 0.1, "walking": 0.1, "standing": 0.05}
"""Recovered: for a second the pitch stays this close to its mean [rad], mean pitch rates below this [rad/s], and the speed over a gait
cycle this close to the command, or, standing, below this with both feet on the ground [m/s]."""


@dataclass(frozen=True)
class PushBench:
    """Push the torso of walking and of standing robots, ten times each.

    Example: teleop-bench push --policy walk_h1 --force 150
    """

    policy: tuple[str, ...] = ()
    """Shipped weights by name, or .safetensors files; none: all that are shipped."""
    force: float = 150.0
    """Force on the torso, from before and behind in turn [N]."""
    seconds: float = 0.2
    """How long it lasts."""
    pushes: int = 10
    """For each of walking and standing."""
    speed: float = 0.5
    """Of the walking robots [m/s]."""
    robot: str = "h1"
    """Name in the catalog."""
    seed: int = 0
    """Of the pushes' moments within the gait cycle."""
    json: Path | None = None
    """Also write the figures to this file."""
    picture: Path | None = None
    """Also draw pitch and pitch rate of every push."""


def run(config: PushBench) -> dict:
    """Push, print the table, return the JSON record."""
    robot, console = catalog.load(config.robot), Console()
    rows, records = [], []
    for policy in config.policy or tuple(checkpoint.known("walk")):
        for what, speed in (("walking", config.speed), ("standing", 0.0)):
            with console.status(f"{policy}, {what}"):
                figures, watched = push(robot, policy, config, speed)
            rows.append({"policy": policy, "what": what} | figures)
            records.append(watched)
    record = {"rows": rows, "force": config.force, "seconds": config.seconds, "seed": config.seed, "commit": commit()}
    Console(width=120).print(_table(config, rows))
    if config.json:
        config.json.write_text(json.dumps(record, indent=1) + "\n")
    if config.picture:
        _draw(rows, records, 1 / robot.spec.policy_rate, config.picture)
    return record


def push(robot: Robot, policy: str, config: PushBench, speed: float) -> tuple[dict, np.ndarray]:
    """Ten robots, each pushed once at its own moment of the gait cycle: means over those that stayed upright, and what each of these did
    from the push on [upright, ticks, 5], as `_one` takes it."""
    n, dt = config.pushes, 1 / robot.spec.policy_rate
    fleet, walk, arms = Fleet(robot, n), Walk(robot, policy, n), Feedforward(robot, n)
    force = fleet.batch.bind("xfrc_applied").reshape(n, -1, 6)[:, fleet.model.body("torso_link").id]
    fleet.reset(np.ones(n, bool))
    upper = np.tile(robot.spec.home[robot.spec.group("waist", "arms")], (n, 1))
    twist, posture = np.tile([speed, 0, 0], (n, 1)), np.tile([robot.spec.nominal_height, 0, 0], (n, 1))
    walk.reset(upper)
    first = BEFORE + np.random.default_rng(config.seed).uniform(0, PERIOD, n)
    direction = np.where(np.arange(n) % 2, 1.0, -1.0)
    state, rows, upright = fleet.state(), [], np.ones(n, bool)
    for tick in range(round((BEFORE + PERIOD + AFTER) / dt)):
        time = tick * dt
        force[:, 0] = config.force * direction * ((time >= first) & (time < first + config.seconds))
        state = fleet.step(np.concatenate([walk.act(state, twist, posture, upper), arms.step(upper, state)], -1))
        upright &= ~fallen(state, fleet)
        roll, pitch = state.roll_pitch.T
        rate = np.cos(roll) * state.gyro[:, 1] - np.sin(roll) * state.gyro[:, 2]
        rows.append(np.column_stack([pitch, rate, state.heading_velocity, state.contact.all(-1)]))
    record, start = np.array(rows), np.round(first / dt).astype(int)
    after = np.array([record[begin : begin + round(AFTER / dt), i] for i, begin in enumerate(start) if upright[i]])
    watched = [_one(one, dt, speed) for one in after]
    means = {name: round(float(np.nanmean([w[name] for w in watched])), 3) for name in watched[0]} if watched else {}
    recovered = sum(np.isfinite(w["recovery"]) for w in watched)
    return {"upright": int(upright.sum()), "recovered": int(recovered), "pushes": n} | means, after


def _one(record: np.ndarray, dt: float, speed: float) -> dict[str, float]:
    """One push; record is [ticks, (pitch, pitch rate, vx, vy, both feet down)] from its beginning."""
    pitch, rate, velocity, standing = record[:, 0], record[:, 1], record[:, 2:4], record[:, 4] > 0
    second, cycle = round(1 / dt), round(PERIOD / dt)
    recovery = float("nan")
    for t in range(len(record) - second):
        window = slice(t, t + second)
        if np.abs(pitch[window] - pitch[window].mean()).max() > STILL["pitch"] or np.abs(rate[window]).mean() > STILL["rate"]:
            continue
        mean = velocity[t : t + cycle].mean(0)
        if speed:
            steady = np.linalg.norm(mean - [speed, 0]) < STILL["walking"]
        else:
            steady = standing[window].all() and np.linalg.norm(velocity[window], axis=-1).max() < STILL["standing"]
        if steady:
            recovery = t * dt
            break
    return {"pitch_rate": np.abs(rate).max(), "pitch_low": pitch.min(), "pitch_high": pitch.max(), "recovery": recovery}


def _table(config: PushBench, rows: list[dict]) -> Table:
    table = Table(title=f"{config.pushes} pushes of {config.force:.0f} N for {config.seconds} s on the torso, from before and behind")
    for name in ("policy", "", "upright", "recovered", "largest pitch rate rad/s", "pitch rad", "recovery s"):
        table.add_column(name, justify="left" if name == "policy" else "right")
    for r in rows:
        cells = ["", "", ""]
        if "pitch_rate" in r:
            cells = [f"{r['pitch_rate']:.3f}", f"{r['pitch_low']:+.3f} to {r['pitch_high']:+.3f}", f"{r['recovery']:.2f}"]
        table.add_row(checkpoint.title(r["policy"]), r["what"], f"{r['upright']}/{r['pushes']}", f"{r['recovered']}/{r['pushes']}", *cells)
    table.add_section()
    for name, cases in PAPER.items():
        for what, (rate, low, high, recovery) in cases.items():
            table.add_row(name, what, "", "", f"{rate:.3f}", f"{low:+.3f} to {high:+.3f}", f"{recovery:.2f}")
    return table


def _draw(rows: list[dict], records: list[np.ndarray], dt: float, path: Path) -> None:
    """A column for each of walking and standing; a thin line for every push, a colour for every policy, dotted where it had recovered."""
    columns = list(dict.fromkeys(row["what"] for row in rows))
    colours = {policy: f"C{i}" for i, policy in enumerate(dict.fromkeys(row["policy"] for row in rows))}
    with canvas(path, 2, len(columns), (11, 6)) as axes:
        for row, record in zip(rows, records, strict=True):
            pair, colour = axes[:, columns.index(row["what"])], colours[row["policy"]]
            for axis, part, unit in zip(pair, (0, 1), ("pitch [rad]", "pitch rate [rad/s]"), strict=True):
                for i, one in enumerate(record):
                    name = checkpoint.title(row["policy"]) if i == 0 else None
                    axis.plot(dt * np.arange(len(one)), one[:, part], colour, linewidth=0.6, alpha=0.5, label=name)
                axis.axvline(row.get("recovery", np.nan), color=colour, linestyle=":")
                axis.set(title=row["what"], xlabel="seconds from the push", ylabel=unit, xlim=(0, 4))
                axis.grid(alpha=0.3)
                axis.legend(fontsize=8)
