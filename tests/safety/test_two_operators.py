"""Two people want the real robot."""

from __future__ import annotations

import json
import time

import numpy as np
import pytest
from program import Program, operator
from stand_ins import eventually


@pytest.mark.row(11)
def test_a_take_over_passes_through_hold_and_never_mixes_two_operators(program: Program, measured) -> None:
    with (
        program.recorded() as recorded,
        operator(program, twist={"vx": 0.4, "vy": 0.0}) as ada,
        operator(program, twist={"vx": -0.2, "vy": 0.3}) as bo,
    ):
        ada.engage()
        time.sleep(0.5)
        bo.fields = {"take": True, "engage": True}
        eventually(lambda: bo.answers[-1]["driving"])
        eventually(lambda: bo.state == "HOLD")
        bo.fields = {"engage": True}
        time.sleep(0.5)
        assert bo.state == "HOLD", "an Engage that is held already is no press"
        bo.engage()
        time.sleep(0.5)
        program.ask("POST", "/api/stop")
        eventually(lambda: bo.state == "STOPPED")
    rows = recorded[0]
    raw, applied, engaged = rows["raw"][:, 1:3], rows["applied"][:, 1:3], rows["mode"] == 2
    of_ada = (abs(raw[:, 0] - 0.4) < 1e-3) & (raw[:, 1] == 0)
    of_bo = (abs(raw[:, 0] + 0.2) < 1e-3) & (raw[:, 1] == 0.3)
    nobody = ~raw.any(axis=1)
    assert (of_ada | of_bo | nobody).all(), "one writer in every tick"
    handed_over = int(np.flatnonzero(of_bo)[0])
    stopped = handed_over + int(np.flatnonzero(rows["mode"][handed_over:] == 0)[0])
    assert not of_ada[handed_over:stopped].any()  # later Bo leaves, and the lease is free for Ada again
    first_of_bo = handed_over + int(np.flatnonzero(engaged[handed_over:])[0])
    between = rows["mode"][handed_over:first_of_bo]
    assert (between == 1).all()
    assert not applied[first_of_bo - 1].any(), "it stood in between"
    held = (first_of_bo - handed_over) * 20
    measured(11, f"take-over: 0 of {len(rows)} ticks mix two operators, {held} ms HOLD until a fresh press; a third client stopped both")


@pytest.mark.row(11)
def test_arms_and_legs_have_a_driver_each(program: Program, measured) -> None:
    with operator(program, roles=["legs"]) as legs, operator(program, roles=["arms"]) as arms:
        legs.engage()
        arms.engage()
        with program.socket("/api/operator") as watcher:
            answer = json.loads(watcher.recv(timeout=5))
        assert answer["roles"]["legs"]["driver"] == legs.answers[-1]["you"]
        assert answer["roles"]["arms"]["driver"] == arms.answers[-1]["you"]
        arms.silence()
        eventually(lambda: legs.answers[-1]["roles"]["arms"]["state"] == "HOLD")
        assert legs.answers[-1]["roles"]["legs"]["state"] == "ENGAGED"
    measured(11, "one drives the legs, another the arms: the arms' operator falls silent, the arms hold, the legs walk on")
