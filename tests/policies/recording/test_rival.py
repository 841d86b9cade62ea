"""Another policy runs through a recording from the same state under the same commands, and both are judged alike."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from policies.command import Command
from policies.episode import EpisodeInfo, Metadata, row_dtype
from policies.recording.provenance import describe
from policies.recording.quality import Judge
from policies.recording.reader import Recording
from policies.recording.rival import Compared, compare
from policies.recording.writer import EpisodeWriter
from robots import catalog
from robots.plant import Plant
from robots.state import State
from robots.target import Target

TICKS, RESET_AT, PUSHED = 60, 40, range(10, 16)
H1 = catalog.load("h1").spec


class Swing:
    """Holds the home pose and moves a shoulder with the clock, the command and what it remembers."""

    def __init__(self, size: float = 0.3, from_tick: int = 0) -> None:
        self.size, self.from_tick, self.ticks = size, from_tick, 0

    def reset(self, state: State) -> None:
        self.ticks = 0

    def act(self, state: State, command: Command) -> Target:
        self.ticks += 1
        q = H1.home.copy()
        size = self.size if self.ticks > self.from_tick else 0.3
        q[H1.group("arms").start] += size * np.sin(self.ticks / 8) + 0.1 * command.waist + 0.01 * state.gravity[0]
        return Target(q)


@pytest.fixture(scope="module")
def plant() -> Plant:
    return Plant(catalog.load("h1"))


@pytest.fixture(scope="module")
def described(plant: Plant) -> tuple[Metadata, bytes]:
    dtype = row_dtype(plant.model.nu, plant.save().size, 4, 0, 2)
    return describe(plant.spec, plant.model, dtype, ["swing"], reasons=("started", "fallen"))


@pytest.fixture(scope="module")
def rows(plant: Plant, described: tuple[Metadata, bytes]) -> np.ndarray:
    """The robot swings its arm, is pushed over and reset."""
    rows, policy = np.zeros(TICKS, described[0].dtype), Swing()
    for tick, row in enumerate(rows):
        row["jump"] = tick in (0, RESET_AT)
        state = plant.reset() if row["jump"] else plant.state()
        if row["jump"]:
            policy.reset(state)
        plant.data.xfrc_applied[1, 0] = 900 if tick in PUSHED else 0
        command = Command(waist=0.01 * tick)
        row["tick"], row["time"], row["mode"], row["applied"] = 500 + tick, plant.data.time, 2, command.vector()
        row["state"] = plant.save()
        row["ctrl"] = policy.act(state, command).q
        plant.step(Target(row["ctrl"]))
    return rows


def compared(folder: Path, described: tuple[Metadata, bytes], rows: np.ndarray, policy: Swing) -> Compared:
    output = io.BytesIO()
    writer = EpisodeWriter(output, *described)
    writer.begin(EpisodeInfo("r", 1, Path(), 0.0))
    writer.rows(rows)
    writer.end(0.0)
    writer.finish()
    (folder / "r.mcap").write_bytes(output.getvalue())
    with Recording(folder / "r.mcap") as recording:
        return compare(recording, recording.infos[0], policy, H1)


def test_the_recorded_policy_does_the_same_bit_for_bit(tmp_path: Path, described: tuple[Metadata, bytes], rows: np.ndarray):
    done = compared(tmp_path, described, rows, Swing())
    assert (done.rows, done.segments, done.after_reset, done.divergence) == (TICKS, 2, True, None)
    assert done.recorded == done.other


def test_the_first_divergence_of_another_policy_is_found(tmp_path: Path, described: tuple[Metadata, bytes], rows: np.ndarray):
    done = compared(tmp_path, described, rows, Swing(size=0.5, from_tick=20))
    assert done.divergence is not None
    assert (done.divergence.tick, done.divergence.motor) == (520, "left_shoulder_pitch_joint")
    assert done.divergence.seconds == pytest.approx(0.4)
    assert done.divergence.difference == pytest.approx(abs(0.2 * np.sin(21 / 8)))
    assert done.other.jerk != done.recorded.jerk


def test_a_start_in_the_middle_of_a_run_is_told(tmp_path: Path, described: tuple[Metadata, bytes], rows: np.ndarray):
    done = compared(tmp_path, described, rows[5:], Swing())
    assert not done.after_reset
    assert done.divergence is not None


def test_rows_of_a_fault_are_no_business_of_a_policy(tmp_path: Path, described: tuple[Metadata, bytes], rows: np.ndarray):
    faulty = rows.copy()
    faulty["mode"][30:RESET_AT] = 3
    assert compared(tmp_path, described, faulty, Swing()).rows == TICKS - 10
    faulty["mode"] = 3
    with pytest.raises(ValueError, match="no row in which a policy drives"):
        compared(tmp_path, described, faulty, Swing())


def test_figures_tell_falls_holds_and_tracking(plant: Plant, described: tuple[Metadata, bytes], rows: np.ndarray):
    judge, marked = Judge(plant.model, H1, described[0]), rows.copy()
    marked["mode"][20:25] = 1
    quality = judge.quality(marked)
    assert (quality.seconds, quality.engaged, quality.holds) == (1.2, 1.1, 1)
    upright = judge.quality(marked[:10])
    assert (upright.falls, upright.at_limit) == (0, 0)
    assert 0 < upright.wrist_error < 0.5
    assert upright.jerk > 0
    lying = marked.copy()
    lying["state"][30:35, 3] = 0.3  # the pelvis on the floor
    assert judge.quality(lying).falls == upright.falls + 1
    asked = marked[:10].copy()
    asked["applied"][:, 1] += 1.0  # a forward velocity that the robot does not have
    assert judge.quality(asked).velocity_error > upright.velocity_error + 0.5


def test_an_arm_at_its_limit_counts(plant: Plant, described: tuple[Metadata, bytes], rows: np.ndarray):
    bent = rows[:4].copy()
    elbow = plant.model.joint("left_elbow_pitch_joint").qposadr[0]
    bent["state"][:2, 1 + elbow] = H1.upper[H1.motor_names.index("left_elbow_pitch_joint")] - 0.01
    assert Judge(plant.model, H1, described[0]).quality(bent).at_limit == 0.5


def test_events_are_in_order_of_time(plant: Plant, described: tuple[Metadata, bytes], rows: np.ndarray):
    marked = np.delete(rows, range(50, 53))
    marked["mode"][30:RESET_AT], marked["reason"][30:RESET_AT] = 3, 1
    marked["state"][30:35, 3] = 0.3
    events = Judge(plant.model, H1, replace(described[0], rate=50.0)).events(marked)
    assert [event.seconds for event in events] == sorted(event.seconds for event in events)
    told = {(event.kind, event.seconds): event.text for event in events}
    assert told["fault", 0.6] == "fallen"
    assert ("fell", 0.6) in told
    assert ("reset", 0.8) in told
    assert told["gap", 1.0] == "3 ticks are missing"
