"""The loop on a hanging robot: what reaches the policy, what is published, and what a failure does."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from stand_ins import AtHome, Faulty, HangingPlant

from app.inputs.operator import Operators
from app.loop import Loop
from app.mode import Mode, Reason
from app.protocol import OperatorMessage
from app.shared import Memory
from policies.command import Command
from robots import catalog


class Rig:
    """A loop and an operator, without a clock: `tick` as often as you like."""

    def __init__(self, policy: Callable[[np.ndarray], AtHome] = AtHome) -> None:
        self.plant = HangingPlant(catalog.load("h1"))
        self.policy = policy(self.plant.spec.home)
        self.loop = Loop(self.plant, self.policy, Memory())
        self.snapshots, self.rows = self.loop.exchange.snapshots, self.loop.exchange.rows
        self.operators = Operators(self.loop.exchange.commands, self.applied)
        self.client = self.operators.join()
        self.tick()

    def applied(self) -> Command:
        return Command.from_vector(self.snapshots.newest()["applied"])

    def say(self, **fields) -> None:
        self.operators.hear(self.client, OperatorMessage(seq=1, **fields))

    def tick(self, ticks: int = 1) -> np.void:
        for _ in range(ticks):
            self.loop.tick()
        return self.snapshots.newest()

    def state(self) -> tuple[Mode, Reason]:
        newest = self.snapshots.newest()
        return Mode(newest["mode"]), Reason(newest["reason"])


@pytest.fixture
def rig() -> Rig:
    return Rig()


def test_a_tick_takes_the_operators_command_through_guard_and_policy_to_a_row(rig: Rig) -> None:
    rig.say(engage=True, twist={"vx": 0.5})
    rig.tick(2)
    assert rig.state() == (Mode.ENGAGED, Reason.ENGAGED)
    row = rig.rows.newest()
    assert 0 < row["applied"][1] < row["raw"][1] == 0.5
    assert rig.policy.commands[-1].twist[0] == row["applied"][1]
    np.testing.assert_array_equal(row["ctrl"], rig.plant.spec.home)
    assert row["observation"].tolist() == [5] * 5
    assert row["latency"][3] > 0, "physics takes time"


def test_rows_are_numbered_without_gaps_and_hold_the_state_before_their_step(rig: Rig) -> None:
    state = rig.plant.save()
    rig.tick(3)
    rows, lost = rig.rows.since(0)
    assert [int(row["tick"]) for row in rows] == [0, 1, 2, 3]
    assert lost == 0
    np.testing.assert_array_equal(rows[1]["state"], state)
    assert rows[1]["time"] == pytest.approx(rig.plant.substeps * rig.plant.model.opt.timestep)
    assert [int(row["jump"]) for row in rows] == [1, 0, 0, 0]


def test_the_snapshot_shows_the_robot(rig: Rig) -> None:
    newest = rig.tick()
    np.testing.assert_array_equal(newest["qpos"], rig.plant.data.qpos)
    np.testing.assert_allclose(newest["actual"][:, 2], newest["target"][:, 2], atol=0.05)
    assert newest["upright"]
    assert newest["limited_by"].tolist() == [b"", b"reach"]


def test_reset_goes_home_and_forgets(rig: Rig) -> None:
    rig.say(engage=True, height=0.9)
    rig.tick(20)
    rig.plant.drop()
    rig.tick(2)
    assert rig.state() == (Mode.FAULT, Reason.FALLEN)
    resets = rig.policy.resets
    rig.operators.reset()
    newest = rig.tick()
    assert rig.state() == (Mode.STOPPED, Reason.RESET), "Engage is still held, but that is no fresh press"
    assert newest["jump"]
    assert newest["upright"]
    assert rig.applied().height == 1.0
    assert rig.policy.resets == resets + 1


def test_a_seeded_reset_starts_elsewhere_with_the_wrists_left_where_they_are(rig: Rig) -> None:
    home = rig.tick()
    rig.operators.reset(seed=5)
    rig.tick()
    varied = rig.rows.newest()
    assert varied["jump"]
    assert not np.array_equal(varied["state"][1:3], home["qpos"][:2])
    assert not np.allclose(rig.applied().wrists, home["applied"][7:21].reshape(2, 7), atol=1e-3)
    rig.operators.reset()
    rig.tick()
    np.testing.assert_array_equal(rig.rows.newest()["state"][1:3], home["qpos"][:2])


def test_after_a_fall_the_policy_is_not_asked_any_more(rig: Rig) -> None:
    rig.plant.drop()
    rig.tick(2)
    asked = len(rig.policy.commands)
    rig.tick(5)
    assert len(rig.policy.commands) == asked


@pytest.mark.row(7)
@pytest.mark.parametrize("failure", ["nan", "shape", "raise", "late"])
def test_one_bad_action_repeats_the_last_good_one_and_two_are_a_fault(failure: str) -> None:
    rig = Rig(lambda home: Faulty(home, ["ok", "ok", failure, "ok", failure, failure]))
    good = rig.policy.home + 0.01
    for _ in range(3):
        rig.tick()
        np.testing.assert_array_equal(rig.rows.newest()["ctrl"], good)
        assert rig.state()[0] == Mode.STOPPED
    rig.tick()
    assert rig.state()[0] == Mode.STOPPED
    rig.tick()
    assert rig.state() == (Mode.FAULT, Reason.POLICY_FAILED)
    rig.tick(60)
    assert rig.state() == (Mode.FAULT, Reason.POLICY_FAILED), "it latches although the policy is well again"
    np.testing.assert_array_equal(rig.rows.newest()["ctrl"], rig.policy.home)


def test_the_default_pose_is_reached_slowly() -> None:
    rig = Rig(lambda home: Faulty(home, ["nan"] * 2))
    rig.tick(100)
    ctrl = np.array([row["ctrl"] for row in rig.rows.since(3)[0]])
    assert np.abs(np.diff(ctrl, axis=0)).max() <= 0.02 + 1e-9


@pytest.mark.row(9)
def test_physics_that_diverges_goes_back_to_the_last_good_state(rig: Rig) -> None:
    rig.tick(10)
    resets = rig.policy.resets
    before = rig.snapshots.newest()
    rig.plant.data.xfrc_applied[5] = np.nan
    newest = rig.tick()
    assert rig.state() == (Mode.FAULT, Reason.PHYSICS_DIVERGED)
    assert np.isfinite(newest["qpos"]).all()
    assert abs(newest["time"] - before["time"]) < 0.05
    np.testing.assert_allclose(newest["qpos"], before["qpos"], atol=0.05)
    after = rig.tick(5)
    assert after["time"] > newest["time"], "it goes on"
    assert rig.policy.resets == resets + 1
    jumps = [int(row["jump"]) for row in rig.rows.since(0)[0]]
    assert jumps[-6:] == [0, 1, 0, 0, 0, 0], "no silent teleport"
    assert np.isfinite(rig.plant.data.xfrc_applied).all()


def test_physics_that_diverges_again_at_once_starts_from_home(rig: Rig) -> None:
    rig.tick(10)
    for _ in range(2):
        rig.plant.data.qvel[7] = np.nan
        rig.tick()
    assert rig.snapshots.newest()["time"] == 0
    assert rig.tick(3)["time"] > 0


def test_a_bad_command_in_shared_memory_never_reaches_the_policy(rig: Rig) -> None:
    record = np.zeros((), rig.loop.exchange.commands.dtype)
    record["vector"] = np.nan
    rig.loop.exchange.commands.push(record)
    assert rig.tick()["rejected"] == 1
    assert all(np.isfinite(command.vector()).all() for command in rig.policy.commands)
