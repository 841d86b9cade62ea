"""`teleop-bench arms`: how exact, how safe and how quick the arms' inverse kinematics is."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

from policies.bench import reach
from policies.commit import commit
from robots import catalog


@dataclass(frozen=True)
class ArmsBench:
    """Ask the arms for many wrist poses: reachable, too far, inside the body, no poses at all.

    Example: teleop-bench arms --targets 1000 --json arms.json
    """

    robot: str = "h1"
    """Name in the catalog."""
    targets: int = 1000
    """Random pairs of targets in the sweep; a tenth of them is also judged for accuracy."""
    seed: int = 0
    """Of the targets."""
    json: Path | None = None
    """Also write the figures to this file."""


def run(config: ArmsBench) -> dict:
    """Measure, print a table, return the JSON record."""
    console = Console()
    with console.status(f"{config.targets} pairs of targets, about {config.targets / 25:.0f} s"):
        record = reach.measure(catalog.load(config.robot), config.targets, config.seed) | {"seed": config.seed, "commit": commit()}
    table = Table(title="arms", show_header=False)
    for name, value in _flat(record):
        table.add_row(name, f"{value:.4g}" if isinstance(value, float) else str(value))
    console.print(table)
    if config.json:
        config.json.write_text(json.dumps(record, indent=1) + "\n")
    return record


def _flat(record: dict, above: str = "") -> list[tuple[str, object]]:
    """Nested figures as lines: (path, value)."""
    lines = []
    for name, value in record.items():
        path = f"{above} {name}".strip().replace("_", " ")
        lines += _flat(value, path) if isinstance(value, dict) else [(path, value)]
    return lines
