"""A small session of the real robot: three episodes, two tasks, one failure, one reset and one gap."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from policies.episode import EpisodeInfo, row_dtype
from policies.recording.provenance import describe
from policies.recording.writer import EpisodeWriter
from robots import catalog
from robots.plant import Plant
from robots.target import Target

EPISODES = (("pick up the cup", True, 24), ("wave", False, 16), ("pick up the cup", None, 20))
"""Task, success and rows."""


@pytest.fixture(scope="session")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The recording."""
    plant = Plant(catalog.load("h1"))
    dtype = row_dtype(plant.model.nu, plant.save().size, 4, 0, 2)
    path = tmp_path_factory.mktemp("session") / "lab.mcap"
    with path.open("wb") as output:
        writer, tick = EpisodeWriter(output, *describe(plant.spec, plant.model, dtype, ["walk"])), 100  # pyright: ignore[reportArgumentType]
        for number, (task, success, count) in enumerate(EPISODES, 1):
            writer.begin(EpisodeInfo(f"lab_{number:03d}", number, path, 1e9 + number, label=task))
            rows = np.zeros(count, dtype)
            for row in rows:
                target = plant.spec.home + 0.3 * np.sin(tick / 9 + np.arange(plant.model.nu))
                row["tick"], row["wall"], row["time"], row["state"], row["ctrl"] = (
                    tick,
                    1e9 + tick / 50,
                    plant.data.time,
                    plant.save(),
                    target,
                )
                row["applied"][0], row["applied"][10], row["raw"][1] = 1, tick * 0.1, -0.0
                plant.step(Target(np.clip(target, plant.spec.lower, plant.spec.upper)))
                tick += 3 if (number, tick) == (3, 145) else 1
            writer.rows(rows)
            writer.end(1e9 + number, success=success)
        writer.finish()
    return path
