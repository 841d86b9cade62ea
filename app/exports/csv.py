"""Plain tables for spreadsheets and quick plots: one CSV file an episode, numbers in full precision."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

import numpy as np

from app.exports.anatomy import BASE, COMMAND
from app.exports.demonstration import Demonstration, Demonstrations
from app.exports.format import Frames
from policies.episode import MODES

SINGLE = ("tick", "time", "wall", "reason", "jump")
VECTORS = ("position", "velocity", "target", "base", "command", "received")


class Csv:
    """A folder of tables; the first line names the columns."""

    packages: ClassVar = ()
    pictures: ClassVar = False
    fps: ClassVar = None
    tolerance: ClassVar = 0.0

    def __init__(self, path: Path, demonstrations: Demonstrations, cameras: tuple[str, ...], size: tuple[int, int]) -> None:
        motors = demonstrations.anatomy.motors
        names = {"base": BASE, "command": COMMAND, "received": COMMAND}
        self._path = path
        self._columns = {vector: [f"{vector}.{name}" for name in names.get(vector, motors)] for vector in VECTORS}

    def add(self, demonstration: Demonstration, frames: Frames) -> None:
        """One table."""
        signals = demonstration.signals
        modes = [MODES[mode] if mode < len(MODES) else str(mode) for mode in signals["mode"]]
        vectors = np.concatenate([signals[name] for name in VECTORS], axis=1).tolist()
        singles = zip(*(signals[name].tolist() for name in SINGLE), strict=True)
        with self._file(demonstration).open("w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow([*SINGLE, "mode", *(column for columns in self._columns.values() for column in columns)])
            writer.writerows([*single, mode, *row] for single, mode, row in zip(singles, modes, vectors, strict=True))

    def finish(self) -> None:
        """Each table stands for itself."""

    def read(self, demonstration: Demonstration) -> Mapping[str, np.ndarray]:
        """Signals of one table."""
        with self._file(demonstration).open(newline="") as file:
            lines = csv.reader(file)
            header = next(lines)
            cells = dict(zip(header, zip(*lines, strict=True), strict=True))
        found = {name: np.array(cells[name], float) for name in ("time", "wall")}
        found |= {name: np.array(cells[name], np.uint64) for name in ("tick", "reason", "jump")}
        vectors = {name: np.array([cells[column] for column in columns], float).T for name, columns in self._columns.items()}
        return found | vectors | {"mode": np.array([MODES.index(mode) for mode in cells["mode"]], np.uint8), "frames": np.empty(0, int)}

    def _file(self, demonstration: Demonstration) -> Path:
        return self._path / f"episode_{demonstration.index:06d}_{demonstration.info.id}.csv"
