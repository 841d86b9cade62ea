"""`teleop-train curves`: a run's learning curves as one picture."""

from __future__ import annotations

import csv
import sys
from dataclasses import dataclass
from pathlib import Path

PANELS = {
    "share of an episode survived": ("survived",),
    "velocity reward": ("velocity",),
    "contacts as scheduled (1 at most)": ("contact",),
    "time in the air, a foot": ("air_walking", "air_standing"),
    "mean velocity error [m/s, rad/s]": ("error_vx", "error_vy", "error_yaw"),
    "curriculum": ("amplitude", "penalty"),
}


@dataclass(frozen=True)
class CurvesConfig:
    """Draw the curves of a run.

    Example: teleop-train curves --run runs/walk --out docs/walk.png
    """

    run: Path = Path("runs/walk")
    """Folder with curves.csv."""
    out: Path = Path("curves.png")
    """Picture to write."""


def draw(config: CurvesConfig) -> Path:
    """Write the picture; returns its path."""
    table = config.run / "curves.csv"
    if not table.is_file():
        sys.exit(f"teleop-train: {table} does not exist; `teleop-train walk --run {config.run}` writes it")
    rows = list(csv.DictReader(table.read_text().splitlines()))
    from matplotlib.figure import Figure  # half a second that only this command needs

    figure = Figure(figsize=(11, 6), layout="constrained")
    steps = [float(r["steps"]) / 1e6 for r in rows]
    begins = [s for s, row, last in zip(steps[1:], rows[1:], rows, strict=False) if row["stage"] != last["stage"]]
    for axis, (title, names) in zip(figure.subplots(2, 3).flat, PANELS.items(), strict=True):
        for name in names:
            points = [(s, float(r[name])) for s, r in zip(steps, rows, strict=True) if r.get(name)]
            if points:
                axis.plot(*zip(*points, strict=True), label=name, linewidth=1)
        for begin in begins:
            axis.axvline(begin, color="grey", linewidth=0.5, linestyle=":")
        axis.set_title(title, fontsize=10)
        axis.set_xlabel("million steps", fontsize=8)
        axis.set_ylim(bottom=0)
        axis.grid(alpha=0.3)
        if len(names) > 1:
            axis.legend(fontsize=8)
    config.out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(config.out, dpi=80)
    return config.out
