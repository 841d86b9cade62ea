"""A canvas for the pictures of trainings and benches, written as one PNG."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np


@contextmanager
def canvas(path: Path, rows: int, columns: int, size: tuple[float, float]) -> Iterator[np.ndarray]:
    """Axes [rows, columns] to draw on; the picture is written when the block ends without an error.

    Args:
        path: PNG to write; its folder is made.
        size: width and height [inch].
    """
    from matplotlib.figure import Figure  # half a second that only pictures need

    figure = Figure(figsize=size, layout="constrained")
    yield figure.subplots(rows, columns, squeeze=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=80)
