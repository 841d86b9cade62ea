"""`teleop-bench robustness`: the paper's figure of pushes and of motions played faster, as a table and a picture."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from policies import checkpoint
from policies.bench.motions import motions
from policies.bench.tracking import Conditions, track
from policies.commit import commit
from policies.picture import canvas
from robots import catalog

SHOWN = {"jpe": "joint error E_jpe [rad]", "gravity": "projected gravity E_g [m/s2]", "survival": "survival"}


@dataclass(frozen=True)
class RobustnessBench:
    """Push robots that play recorded motions, then play the motions slower and faster.

    Example: teleop-bench robustness --motions runs/clips.npz --picture robustness.png
    """

    motions: Path | None = None
    """As in `teleop-bench paper`."""
    policy: tuple[str, ...] = ()
    """Shipped weights by name, or .safetensors files; none: all that are shipped."""
    push: tuple[float, ...] = (0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5)
    """Sudden changes of velocity every 5 s [m/s]."""
    speed: tuple[float, ...] = (0.5, 0.75, 1.0, 1.25, 1.5, 2.0)
    """Playback speeds."""
    robot: str = "h1"
    """Name in the catalog."""
    repeats: int = 5
    """Rollouts a motion."""
    seed: int = 0
    """Of starts and pushes."""
    json: Path | None = None
    """Also write the figures to this file."""
    picture: Path | None = None
    """Also draw them."""


def run(config: RobustnessBench) -> dict:
    """Roll out every level, print the table, return the JSON record."""
    robot = catalog.load(config.robot)
    clips = motions(robot, config.motions)
    policies = config.policy or tuple(checkpoint.known("walk"))
    levels = [("push", value) for value in config.push] + [("speed", value) for value in config.speed]
    rows = []
    with Progress(transient=True) as progress:
        task = progress.add_task("", total=len(policies) * len(levels))
        for policy in policies:
            for what, value in levels:
                progress.update(task, description=f"{policy}: {what} {value}")
                score = track(robot, policy, clips, Conditions(config.repeats, config.seed, **{what: value}))
                rows.append({"policy": policy, what: value} | score.mean())
                progress.advance(task)
    record = {"rows": rows, "clips": len(clips), "repeats": config.repeats, "seed": config.seed, "commit": commit()}
    Console(width=120).print(_table(rows))
    if config.json:
        config.json.write_text(json.dumps(record, indent=1) + "\n")
    if config.picture:
        _draw(rows, config.picture)
    return record


def _table(rows: list[dict]) -> Table:
    table = Table(title="robustness")
    for name in ("policy", "push m/s", "speed", *SHOWN.values()):
        table.add_column(name, justify="left" if name == "policy" else "right")
    for row in rows:
        values = f"{row['jpe']:.4f}", f"{row['gravity']:.3f}", f"{row['survival']:.1%}"
        table.add_row(checkpoint.title(row["policy"]), str(row.get("push", "")), str(row.get("speed", "")), *values)
    return table


def _draw(rows: list[dict], path: Path) -> None:
    with canvas(path, 2, 3, (11, 5.5)) as axes:
        for line, (what, label) in zip(axes, {"push": "push [m/s]", "speed": "motion speed"}.items(), strict=True):
            for axis, (measure, title) in zip(line, SHOWN.items(), strict=True):
                for policy in dict.fromkeys(row["policy"] for row in rows):
                    points = [(row[what], row[measure]) for row in rows if row["policy"] == policy and what in row]
                    axis.plot(*zip(*points, strict=True), marker="o", label=checkpoint.title(policy))
                axis.set(title=title, xlabel=label)
                axis.set_ylim(bottom=0)
                axis.grid(alpha=0.3)
                axis.legend(fontsize=8)
