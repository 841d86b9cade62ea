"""What breaks inside: the real robot and the real policy in the real loop, tick by tick without a clock."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator

import mujoco
import numpy as np
import pytest
from program import Program, operator
from stand_ins import eventually

from app.factory import Factory
from app.failsafe import TracedPolicy
from app.inputs.operator import Operators
from app.loop import Loop
from app.mode import Mode, Reason
from app.protocol import OperatorMessage
from app.shared import Memory
from policies import checkpoint
from policies.bench import reach
from policies.command import Command
from robots import catalog
from robots.plant import Plant
from robots.state import FALLEN_TILT, State
from robots.target import Target

TICK = 0.02


class Faulty:
    """The real policy until it is told what to do instead."""

    def __init__(self, policy: TracedPolicy) -> None:
        self._policy, self.fault = policy, ""

    def __getattr__(self, name: str) -> object:
        return getattr(self._policy, name)

    def act(self, state: State, command: Command) -> Target:
        target = self._policy.act(state, command)
        if self.fault == "exception":
            raise RuntimeError("on purpose")
        if self.fault == "late":
            time.sleep(0.25)
        bad = {"NaN": np.full_like(target.q, np.nan), "infinite": np.full_like(target.q, np.inf), "shape": target.q[:3]}
        return Target(bad.get(self.fault, target.q))


class Rig:
    """A loop and an operator who walks and speaks in every tick."""

    def __init__(self, built: tuple[Plant, TracedPolicy]) -> None:
        self.plant, self.policy = built[0], Faulty(built[1])
        self.plant.reset()
        self.loop = Loop(self.plant, self.policy, Memory())  # type: ignore[arg-type]
        exchange = self.loop.exchange
        self.rows, self.snapshots = exchange.rows, exchange.snapshots
        self.operators = Operators(exchange.commands, lambda: Command.from_vector(self.snapshots.newest()["applied"]))
        self.client, self._seq = self.operators.join(), 0
        self.tick()

    def tick(self, ticks: int = 1, **fields: object) -> np.void:
        for _ in range(ticks):
            self._seq += 1
            if fields:
                self.operators.hear(self.client, OperatorMessage.model_validate({"seq": self._seq, **fields}))
            self.loop.tick()
        return self.snapshots.newest()

    def walk(self, ticks: int) -> np.void:
        newest = self.tick(ticks, engage=True, twist={"vx": 0.4})
        assert Mode(newest["mode"]) == Mode.ENGAGED
        return newest

    @property
    def reason(self) -> Reason:
        return Reason(self.snapshots.newest()["reason"])


@pytest.fixture(scope="module")
def built() -> Iterator[tuple[Plant, TracedPolicy]]:
    yield Factory("h1", str(checkpoint.find("walk_h1", "walk")))()
    mujoco.set_mju_user_warning(None)


@pytest.fixture
def rig(built: tuple[Plant, TracedPolicy]) -> Rig:
    return Rig(built)


@pytest.mark.row(7)
@pytest.mark.parametrize("fault", ["NaN", "infinite", "shape", "exception", "late"])
def test_a_policy_that_fails_is_a_fault_after_two_ticks(rig: Rig, fault: str, measured) -> None:
    rig.walk(40)
    good = rig.rows.newest()["ctrl"]
    rig.policy.fault = fault
    rig.walk(1)
    np.testing.assert_array_equal(rig.rows.newest()["ctrl"], good)
    ticks = 1
    while rig.reason != Reason.POLICY_FAILED:
        rig.tick()
        ticks += 1
        assert ticks <= 2
    ctrl = []
    for _ in range(50):
        ctrl.append(rig.rows.newest()["ctrl"])
        rig.tick()
    assert np.isfinite(ctrl).all()
    assert np.abs(np.diff(ctrl, axis=0)).max() <= 1.0 * TICK + 1e-9
    measured(7, f"{fault}: FAULT in tick {ticks}, then every motor towards the default pose at 1 rad/s")


@pytest.mark.row(8)
@pytest.mark.parametrize("direction", [(1, 0), (-1, 0), (0, 1), (0, -1)], ids=["forward", "back", "left", "right"])
def test_a_push_that_fells_it_is_a_fault_and_reset_stands_it_up(rig: Rig, direction: tuple[int, int], measured) -> None:
    rig.walk(40)
    pelvis = rig.plant.model.body(rig.plant.spec.bodies[0].name).id
    fallen_at = ticks = None
    for tick in range(400):
        rig.plant.data.xfrc_applied[pelvis, :2] = 900.0 * np.array(direction) if tick < 25 else 0.0
        newest = rig.tick(engage=True, twist={"vx": 0.4})
        roll, pitch = newest["base"][4:6]
        tilt = np.arccos(np.clip(np.cos(roll) * np.cos(pitch), -1, 1))
        if fallen_at is None and (tilt > FALLEN_TILT or newest["base"][2] < rig.plant.spec.nominal_height / 2):
            fallen_at = tick
        if Mode(newest["mode"]) == Mode.FAULT:
            ticks = tick - fallen_at if fallen_at is not None else 0
            break
    assert rig.reason == Reason.FALLEN
    assert ticks is not None
    assert ticks * TICK <= 0.2
    assert rig.tick(3) is not None
    assert rig.rows.newest()["reason"] == Reason.FALLEN, "the recording marks it"
    rig.operators.reset()
    rig.tick(100)
    newest = rig.snapshots.newest()
    assert (Mode(newest["mode"]), bool(newest["upright"])) == (Mode.STOPPED, True)
    assert newest["base"][2] > 0.9
    measured(8, f"pushed {direction} until it fell: FAULT {1e3 * ticks * TICK:.0f} ms later, stands 2 s after Reset")


@pytest.mark.row(9)
@pytest.mark.parametrize("what", ["force", "velocity", "position", "huge force"])
def test_physics_that_diverges_is_undone_and_told(rig: Rig, what: str, measured) -> None:
    rig.walk(60)
    before = rig.snapshots.newest()
    data = rig.plant.data
    place = {"force": data.xfrc_applied[3], "velocity": data.qvel[9:12], "position": data.qpos[9:12], "huge force": data.xfrc_applied[3]}
    place[what][:] = 1e30 if what == "huge force" else np.nan
    ticks = 0
    while Mode(rig.snapshots.newest()["mode"]) != Mode.FAULT:
        rig.tick()
        ticks += 1
        assert ticks < 3
    newest = rig.snapshots.newest()
    moved = float(np.abs(newest["qpos"] - before["qpos"]).max())
    assert rig.reason == Reason.PHYSICS_DIVERGED
    assert np.isfinite(newest["qpos"]).all()
    assert abs(newest["time"] - before["time"]) <= 0.05, "time did not start again"
    assert moved < 0.1
    rig.tick(3)
    assert 1 in [int(row["jump"]) for row in rig.rows.since(rig.rows.count - 4)[0]]
    rig.operators.reset()
    assert rig.tick(50)["upright"]
    measured(9, f"{what}: back to the last good state in tick {ticks}, qpos {moved:.3f} from before, FAULT, jump recorded")


@pytest.mark.row(6)
@pytest.mark.parametrize("count", [60, pytest.param(1000, marks=pytest.mark.slow)])
def test_arms_are_asked_for_anything_and_nothing_happens(count: int, measured) -> None:
    swept = reach._Bench(catalog.load("h1"), seed=count).sweep(count, ticks=25)
    assert swept["exceptions"] == 0
    assert swept["beyond_limits_rad"] < 1e-6
    assert swept["deepest_overlap_mm"] < 1.0
    reasons = ", ".join(f"{reason or 'none'} {times}" for reason, times in sorted(swept["reasons"].items()))
    overlap = swept["deepest_overlap_mm"]
    measured(6, f"{count} pairs of targets: 0 exceptions, limits kept, overlap {overlap:.2f} mm; told (arm ticks): {reasons}")


@pytest.mark.row(6)
def test_the_page_is_told_why_an_arm_cannot_follow_within_100_ms(program: Program, measured) -> None:
    """The reason stands in the snapshot of the very tick that found it; what counts is its way to the page."""
    far = {"position": [1.2, 0.3, 0.4], "quaternion": [1, 0, 0, 0]}
    with operator(program) as driver:
        driver.engage()
        driver.fields["wrists"] = {"left": far}
        eventually(lambda: driver.answers[-1]["wrists"]["left"]["limited_by"] == "reach", 15)
        shown = driver.answers[-1]["wrists"]["left"]
        assert np.isfinite(shown["reachable"]["position"]).all()
        assert np.linalg.norm(shown["reachable"]["position"]) < 1.0
        gaps = []
        with program.socket("/api/operator") as watcher:
            for _ in range(50):
                arrived, answer = time.monotonic(), json.loads(watcher.recv(timeout=5))
                gaps.append((time.monotonic() - arrived, answer["time"]))
    between = float(np.median([gap for gap, _ in gaps[1:]]))
    assert between <= 0.1
    measured(6, f"out of reach: {shown['limited_by']!r} and the nearest pose in the answer; a new answer every {1e3 * between:.0f} ms")
