"""`teleop-bench paper`: the paper's table I on the H1, for our policy and its ablations, beside the paper's own rows."""

from __future__ import annotations

import json
import platform
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from policies import checkpoint
from policies.bench.motions import motions
from policies.bench.tracking import MEASURES, Conditions, track
from policies.commit import commit
from policies.picture import canvas
from robots import catalog

PAPER = {
    "PMP": (5.07, 0.00280, 0.02161, 0.02355, 0.01296, 0.01947, 13.28, 0.01651, 1.301),
    "ExBody": (11.93, 0.01595, 0.02303, 0.03125, 0.00784, 0.02105, 14.69, 0.01651, 1.367),
    "ExBody (Whole)": (9.97, 0.01576, 0.02474, 0.03788, 0.00782, 0.02051, 14.76, 0.01553, 1.454),
    "w/o prior": (5.24, 0.00282, 0.02146, 0.02425, 0.01349, 0.02081, 13.27, 0.01623, 1.585),
    "w/o curriculum": (5.39, 0.00289, 0.02150, 0.02440, 0.01481, 0.02057, 13.54, 0.01645, 1.597),
}
"""Rows of the paper's table I, H1, in the order of `MEASURES`; its simulator and motions are not ours."""


@dataclass(frozen=True)
class PaperBench:
    """Measure policies as the paper does: motions of people they were not trained on, 5 rollouts each.

    Example: teleop-bench paper --motions runs/clips.npz --policy walk_h1 runs/noprior/walk.safetensors --json paper.json
    """

    motions: Path | None = None
    """Clips of `teleop-train retarget`, of which the validation split is played, or a folder of BVH files; without it, made-up ones."""
    policy: tuple[str, ...] = ()
    """Shipped weights by name, or .safetensors files; none: all that are shipped."""
    robot: str = "h1"
    """Name in the catalog."""
    repeats: int = 5
    """Rollouts a motion."""
    seeds: tuple[int, ...] = (0,)
    """Of starts; each seed is a run of all rollouts."""
    json: Path | None = None
    """Also write the figures to this file."""
    picture: Path | None = None
    """Also draw them, beside the paper's."""


def run(config: PaperBench) -> dict:
    """Roll out, print the table, return the JSON record."""
    robot = catalog.load(config.robot)
    clips = motions(robot, config.motions)
    policies = config.policy or tuple(checkpoint.known("walk"))
    rows = []
    with Progress(transient=True) as progress:
        for policy in policies:
            for seed in config.seeds:
                task = progress.add_task(f"{policy}, seed {seed}", total=1.0)
                score = track(
                    robot, policy, clips, Conditions(config.repeats, seed), lambda done, t=task: progress.update(t, completed=done)
                )
                progress.update(task, completed=1.0)
                rows.append({"policy": policy, "seed": seed, "all": score.mean(), "upright": score.mean(all_rollouts=False)})
    record = {
        "rows": rows, "paper": {name: dict(zip(MEASURES, row, strict=True)) for name, row in PAPER.items()},
        "motions": {"clips": len(clips), "seconds": round(clips.seconds, 1), "commands_clipped": round(score.clipped, 4),
                    "about": clips.about},
        "repeats": config.repeats, "commit": commit(), "machine": f"{platform.machine()}, {platform.processor() or platform.system()}",
    }  # fmt: skip
    console = Console(width=170)
    console.print(_table(record))
    console.print(_beside(record))
    if config.json:
        config.json.write_text(json.dumps(record, indent=1) + "\n")
    if config.picture:
        _draw(record, config.picture)
    return record


def _table(record: dict) -> Table:
    about = record["motions"]
    table = Table(
        title=f"{about['clips']} motions, {record['repeats']} rollouts each; lower is better",
        caption=f"means until the end or a fall; {about['commands_clipped']:.0%} of the commands exceeded the trained range",
    )
    for name in ("policy", "seed", "survival", *(f"{name.replace('_', ' ')}\n{unit}" for name, unit in MEASURES.items())):
        table.add_column(name, justify="left" if name == "policy" else "right")
    for row in record["rows"]:
        cells = [_number(row["all"][name]) for name in MEASURES]
        table.add_row(checkpoint.title(row["policy"]), str(row["seed"]), f"{row['all']['survival']:.1%}", *cells)
    table.add_section()
    for name, values in record["paper"].items():
        table.add_row(f"paper: {name}", "", "", *(_number(value) for value in values.values()))
    return table


def _beside(record: dict) -> Table:
    """What the paper leaves open, read in more than one way."""
    table = Table(title="beside", show_header=True)
    beside = ("velocity_abs", "angular_abs", "jpe_27", "kpe_pelvis", "reference_acc")
    for name in ("policy", "seed", *(name.replace("_", " ") for name in beside), "acc upper / reference", "E_g of the upright"):
        table.add_column(name, justify="right")
    for row in record["rows"]:
        values, upright = row["all"], row["upright"]
        ratio = values["acc_upper"] / max(values["reference_acc"], 1e-9)
        cells = [_number(values[name]) for name in beside] + [f"{ratio:.2f}", _number(upright.get("gravity", float("nan")))]
        table.add_row(checkpoint.title(row["policy"]), str(row["seed"]), *cells)
    return table


def _draw(record: dict, path: Path) -> None:
    """Bars of every measure: means over the seeds, whiskers from the least to the most of them, the paper's rows in grey."""
    ours: dict[str, list[dict]] = {}
    for row in record["rows"]:
        ours.setdefault(checkpoint.title(row["policy"]), []).append(row["all"])
    names = [*ours, *(f"paper: {name}" for name in record["paper"])]
    colours = [*(f"C{i}" for i in range(len(ours))), *["0.75"] * len(record["paper"])]
    with canvas(path, 2, 5, (15, 1.5 + 0.5 * len(names))) as axes:
        for axis, (measure, unit) in zip(axes.flat, ({"survival": "share"} | MEASURES).items(), strict=True):
            runs = [[row[measure] for row in rows] for rows in ours.values()]
            runs += [[row.get(measure, float("nan"))] for row in record["paper"].values()]
            means, least, most = (np.array([of(seeds) for seeds in runs]) for of in (np.mean, np.min, np.max))
            axis.barh(names, means, xerr=[means - least, most - means], color=colours)
            axis.set_ylim(len(names) - 0.5, -0.5)
            axis.locator_params(axis="x", nbins=4)
            axis.set_title(f"{measure.replace('_', ' ')} [{unit}]", fontsize=10)
            axis.tick_params(labelsize=8, labelleft=axis in axes[:, 0])


def _number(value: float) -> str:
    return f"{value:.2f}" if value >= 1 else f"{value:.4f}"
