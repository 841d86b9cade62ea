"""A recording of the real play model replays bit for bit, and anything else is found out."""

import hashlib
import io
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from policies.episode import EpisodeInfo, Metadata, row_dtype
from policies.recording.model import CannotReplay
from policies.recording.provenance import describe
from policies.recording.reader import Recording
from policies.recording.replay import Replayed, replay
from policies.recording.writer import EpisodeWriter
from robots import catalog
from robots.plant import Plant
from robots.target import Target

TICKS = 160
RESET_AT = 90


@pytest.fixture(scope="module")
def plant() -> Plant:
    return Plant(catalog.load("h1"))


@pytest.fixture(scope="module")
def described(plant: Plant) -> tuple[Metadata, bytes]:
    return describe(plant.spec, plant.model, row_dtype(plant.model.nu, plant.save().size, 4, 0, 2), ["none"])


@pytest.fixture(scope="module")
def rows(plant: Plant, described: tuple[Metadata, bytes]) -> np.ndarray:
    """The robot waves, is pushed, falls onto its capsules, and is reset once."""
    plant.reset()
    rows = np.zeros(TICKS, described[0].dtype)
    for tick, row in enumerate(rows):
        if tick == RESET_AT:
            plant.reset()
            row["jump"] = 1
        if tick == 30:
            plant.data.xfrc_applied[1, :2] = (300, 80)
        if tick == 40:
            plant.data.xfrc_applied[:] = 0
        target = plant.spec.home + 0.4 * np.sin(tick / 12 + np.arange(plant.model.nu))
        row["tick"], row["time"], row["state"], row["ctrl"] = tick, plant.data.time, plant.save(), target
        plant.step(Target(target))
    return rows


def replayed(folder: Path, metadata: Metadata, model: bytes | None, rows: np.ndarray) -> Replayed:
    output = io.BytesIO()
    writer = EpisodeWriter(output, metadata, model)
    writer.begin(EpisodeInfo("r", 1, Path(), 0.0))
    writer.rows(rows)
    writer.end(0.0)
    writer.finish()
    path = folder / "r.mcap"
    path.write_bytes(output.getvalue())
    with Recording(path) as recording:
        return replay(recording, recording.infos[0])


def test_the_motion_is_worth_replaying(rows: np.ndarray):
    heights = rows["state"][:, 3]
    assert heights.min() < heights[0] - 0.3


def test_it_is_bit_for_bit_equal(tmp_path: Path, rows: np.ndarray, described: tuple[Metadata, bytes]):
    done = replayed(tmp_path, *described, rows)
    assert (done.rows, done.segments, done.max_difference, done.diverged_at) == (TICKS, 2, 0.0, None)


def test_a_gap_starts_a_new_segment(tmp_path: Path, rows: np.ndarray, described: tuple[Metadata, bytes]):
    done = replayed(tmp_path, *described, np.delete(rows, range(50, 60)))
    assert (done.rows, done.segments, done.diverged_at) == (TICKS - 10, 3, None)


def test_a_tampered_motor_target_is_found(tmp_path: Path, rows: np.ndarray, described: tuple[Metadata, bytes]):
    tampered = rows.copy()
    tampered["ctrl"][20, 15] += 1e-9
    done = replayed(tmp_path, *described, tampered)
    assert done.diverged_at == 21
    assert 0 < done.max_difference < np.inf


def test_a_hidden_jump_is_found(tmp_path: Path, rows: np.ndarray, described: tuple[Metadata, bytes]):
    tampered = rows.copy()
    tampered["jump"] = 0
    assert replayed(tmp_path, *described, tampered).diverged_at == RESET_AT


def test_a_missing_model_is_built_again_when_it_is_the_same(tmp_path: Path, rows: np.ndarray, described: tuple[Metadata, bytes]):
    assert replayed(tmp_path, described[0], None, rows[:20]).diverged_at is None
    with pytest.raises(CannotReplay, match="no intact model"):
        replayed(tmp_path, replace(described[0], model_sha256="0" * 64), None, rows[:20])


def test_another_mujoco_is_named(tmp_path: Path, rows: np.ndarray, described: tuple[Metadata, bytes]):
    metadata = replace(described[0], versions={"mujoco": "2.0.0"})
    with pytest.raises(CannotReplay, match=rf"mujoco 2\.0\.0, here is {mujoco.__version__}"):
        replayed(tmp_path, metadata, described[1], rows[:2])


def test_the_description_names_what_made_the_rows(plant: Plant, tmp_path: Path):
    weights = tmp_path / "w.safetensors"
    weights.write_bytes(b"weights")
    dtype = row_dtype(plant.model.nu, plant.save().size, 4, 0, 2)
    metadata, _ = describe(plant.spec, plant.model, dtype, ["walk"], weights, ("A",))
    assert (metadata.robot, metadata.policy, metadata.substeps, metadata.rate) == ("h1", "walk", 4, 50.0)
    assert metadata.policy_sha256 == hashlib.sha256(b"weights").hexdigest()
    assert metadata.versions["mujoco"] == mujoco.__version__
    assert {"numpy", "torch", "humanoid-teleop"} <= metadata.versions.keys()
