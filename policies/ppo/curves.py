"""`teleop-train curves`: learning curves of one run, or of several side by side, as one picture."""

from __future__ import annotations

import csv
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from policies.picture import canvas

STYLES = ("-", "--", ":")
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
    """Draw the curves of runs.

    Example: teleop-train curves --run runs/walk --out docs/walk.png
    Beside each other: teleop-train curves --run runs/pmp runs/noprior --out ablations.png
    """

    run: tuple[Path, ...] = (Path("runs/walk"),)
    """Folders with curves.csv."""
    smooth: int = 1
    """Mean over so many rows."""
    out: Path = Path("curves.png")
    """Picture to write."""


def draw(config: CurvesConfig) -> Path:
    """Write the picture; returns its path."""
    tables = {run.name: _rows(run / "curves.csv") for run in config.run}
    many = len(tables) > 1
    with canvas(config.out, 2, 3, (11, 6)) as axes:
        for axis, (title, names) in zip(axes.flat, PANELS.items(), strict=True):
            for i, (run, rows) in enumerate(tables.items()):
                for k, name in enumerate(names):
                    points = np.array([(float(r["steps"]) / 1e6, float(r[name])) for r in rows if r.get(name)]).reshape(-1, 2)
                    if len(points) < config.smooth:
                        continue
                    x, y = (np.convolve(column, np.full(config.smooth, 1 / config.smooth), "valid") for column in points.T)
                    label = run if many and axis is axes[0, 0] else name if len(names) > 1 and i == 0 else None
                    axis.plot(x, y, label=label, lw=1, color=f"C{i if many else k}", linestyle=STYLES[k] if many else "-")
                begins = [float(r["steps"]) / 1e6 for r, last in zip(rows[1:], rows, strict=False) if r["stage"] != last["stage"]]
                for begin in begins:
                    axis.axvline(begin, color="grey", linewidth=0.5, linestyle=":")
            axis.set_title(title, fontsize=10)
            axis.set_xlabel("million steps", fontsize=8)
            axis.grid(alpha=0.3)
            if not many:
                axis.set_ylim(bottom=0)
            if axis.get_legend_handles_labels()[0]:
                axis.legend(fontsize=8)
    return config.out


def _rows(table: Path) -> list[dict[str, str]]:
    if not table.is_file():
        sys.exit(f"teleop-train: {table} does not exist; `teleop-train walk --run {table.parent}` writes it")
    return list(csv.DictReader(table.read_text().splitlines()))
