"""Rows of a made-up robot, small and different from each other in every field."""

from collections.abc import Iterable

import numpy as np
import zstandard

from policies.episode import Metadata, row_dtype

NQ, NV, NU = 8, 7, 3
DTYPE = row_dtype(nu=NU, nstate=1 + NQ + NV + NU, nobs=4, nlatent=0, naction=2)
METADATA = Metadata(robot="small", policy="none", dtype=DTYPE, nq=NQ, nv=NV, substeps=4, rate=50.0, reasons=("STARTED", "FALLEN"))
MODEL = bytes(range(256)) * 40
PACKED_MODEL = zstandard.compress(MODEL)
START = 1_780_000_000.0
"""Unix time of tick 0 [s]."""


def make_rows(ticks: Iterable[int]) -> np.ndarray:
    """The rows of these ticks; the same tick always gives the same bytes."""
    rows = [np.frombuffer(np.random.default_rng(tick).bytes(DTYPE.itemsize), DTYPE)[0].copy() for tick in ticks]
    for row, tick in zip(rows, ticks, strict=True):
        row["tick"], row["time"], row["wall"], row["jump"] = tick, tick / 50, START + tick / 50, 0
    return np.array(rows, DTYPE)
