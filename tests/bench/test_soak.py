"""What `teleop-bench soak` says about a process that grows."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from bench.soak import Process

SECONDS = np.arange(0.0, 601.0, 5.0)
WARM = 100 + np.minimum(SECONDS, 60.0)
"""A process that loads 60 MB in its first minute [MB]."""


def test_growth_after_the_warm_up_is_found() -> None:
    leaking = Process(
        0, SECONDS.tolist(), (WARM + 2 * SECONDS / 600).tolist(), WARM.tolist(), [20 + int(t // 100) for t in SECONDS]
    ).summary()
    assert leaking["own_megabytes_per_10_minutes"] == pytest.approx(2.0)
    assert leaking["handles_grown"] == 4, "of 6, one came while it warmed up"
    steady = Process(0, SECONDS.tolist(), WARM.tolist(), WARM.tolist(), [20] * len(SECONDS)).summary()
    assert steady["own_megabytes_per_10_minutes"] == pytest.approx(0.0, abs=1e-6)
    assert steady["handles_grown"] == 0


@pytest.mark.skipif(not Path("/proc/self/smaps_rollup").exists(), reason="reads processes as Linux shows them")
def test_a_process_is_looked_at() -> None:
    process = Process(os.getpid())
    process.look(0.0)
    assert 10 < process.megabytes[0] < process.shares[0]
    assert process.handles[0] >= 3
