"""/metrics as Prometheus reads it."""

from __future__ import annotations

import os

import pytest
from fastapi import FastAPI
from prometheus_client.parser import text_string_to_metric_families
from stand_ins import eventually

from app.inputs.operator import Operators
from app.outputs import metrics
from app.outputs.telemetry import Names, Telemetry
from app.simulation import Simulation


@pytest.fixture
def read(simulation: Simulation):
    """Reads it: (metric, label value) -> number."""
    operators = Operators(simulation.exchange.commands, simulation.applied)
    telemetry = Telemetry(Names("h1", ("none",), 50.0), simulation, operators)

    def stopped() -> bool:  # whatever another test left behind
        operators.stop()
        return telemetry.health().state == "STOPPED"

    eventually(stopped)
    app = FastAPI()
    app.include_router(metrics.router(telemetry.health, lambda: simulation.pid))
    (endpoint,) = [route.endpoint for route in app.routes[-1].effective_candidates()]

    def values() -> dict[tuple[str, str], float]:
        families = text_string_to_metric_families(endpoint().body.decode())
        return {(s.name, " ".join(s.labels.values())): s.value for family in families for s in family.samples}

    return values


def test_the_robot_and_both_processes_are_told(read, simulation: Simulation) -> None:
    before = read()
    assert before[("teleop_state", "STOPPED")] == 1
    assert before[("teleop_state", "FAULT")] == 0
    assert before[("teleop_upright", "")] == 1
    assert before[("teleop_real_time_factor", "")] > 0
    assert {name for name, _ in before} >= {"teleop_missed_ticks_total", "teleop_lateness_seconds", "teleop_stage_seconds"}
    for process in ("web", "simulation"):
        assert before[(f"teleop_{process}_process_resident_memory_bytes", "")] > 1e7
        assert before[(f"teleop_{process}_process_open_fds", "")] > 3
    eventually(lambda: read()[("teleop_ticks_total", "")] > before[("teleop_ticks_total", "")])


def test_a_dead_simulation_is_a_fault_and_no_error(read, simulation: Simulation) -> None:
    os.kill(simulation.pid or 0, 9)
    eventually(lambda: read()[("teleop_state", "FAULT")] == 1)
    assert ("teleop_simulation_process_open_fds", "") not in read()
