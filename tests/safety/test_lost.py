"""Operator, web process or simulation are gone or hang, while the real robot walks."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from program import Operator, Program, operator, since_last_message
from proxy import Proxy
from stand_ins import eventually

from app import recordings

Lose = Callable[[Operator, Proxy], None]

WAYS: dict[str, Lose] = {
    "reset": lambda driver, proxy: driver.vanish(),
    "silent": lambda driver, proxy: driver.silence(),
    "blackhole": lambda driver, proxy: setattr(proxy, "blackhole", True),
    "cut": lambda driver, proxy: proxy.cut(),
    "delayed": lambda driver, proxy: setattr(proxy, "delay", 1.0),
}


def lose(program: Program, how: Lose) -> tuple[float, float]:
    """Walk, lose the operator: seconds until HOLD and until no velocity."""
    with program.recorded() as recorded, Proxy(program.port) as proxy, operator(program, proxy.port) as driver:
        driver.engage()
        time.sleep(1.0)
        how(driver, proxy)
        time.sleep(0.8)
    eventually(lambda: program.health["driver"] is None, 3.0)
    time.sleep(1.0)
    assert program.health["upright"]
    rows = recorded[0]
    cut = int(np.flatnonzero(rows["mode"] == 2)[-1]) + 2  # a delayed message comes after the robot let go
    held, stood, longest = since_last_message(rows[: np.flatnonzero(~rows["applied"][cut:, 1:4].any(axis=1))[0] + cut + 1])
    assert held <= 0.2 + longest
    assert stood <= 0.3 + longest
    return held, stood


@pytest.mark.row(1)
@pytest.mark.parametrize("how", WAYS)
def test_a_lost_operator_leaves_a_standing_robot(program: Program, how: str, measured) -> None:
    held, stood = lose(program, WAYS[how])
    measured(1, f"{how}: HOLD after {1e3 * held:.0f} ms, no velocity after {1e3 * stood:.0f} ms")


@pytest.mark.slow
@pytest.mark.row(1)
def test_twenty_losses_of_twenty_end_upright(program: Program, measured) -> None:
    times = np.array([lose(program, list(WAYS.values())[i % len(WAYS)]) for i in range(20)])
    held, stood = 1e3 * times.max(axis=0)
    measured(1, f"20 of 20 upright; HOLD after {held:.0f} ms at most, no velocity after {stood:.0f} ms at most")


@pytest.fixture
def own_program(tmp_path: Path) -> Iterator[Program]:
    """A program to kill."""
    program = Program(tmp_path)
    yield program
    program.close()


@pytest.mark.row(2)
def test_a_web_process_that_hangs_leaves_a_standing_robot(program: Program, measured) -> None:
    with program.recorded() as recorded, operator(program) as driver:
        driver.engage()
        time.sleep(1.0)
        os.kill(program.pid, signal.SIGSTOP)
        time.sleep(1.0)
        os.kill(program.pid, signal.SIGCONT)
        time.sleep(0.5)
    rows = recorded[0]
    held = int(np.flatnonzero((rows["mode"][1:] == 1) & (rows["mode"][:-1] == 2))[-1]) + 1
    silent = int(np.flatnonzero(np.diff(rows["raw"][:held, 1]))[-1]) + 1
    after = rows["wall"][held] - (rows["wall"][silent] - rows["latency"][silent, 0] * 1e-3)
    assert after <= 0.2 + np.diff(rows["wall"][silent : held + 1]).max()
    assert program.health["upright"]
    measured(2, f"web process stopped for 1 s: HOLD after {1e3 * after:.0f} ms, 0 rows lost")


@pytest.mark.row(2)
def test_a_web_process_that_is_killed_takes_the_simulation_with_it_and_the_file_recovers(own_program: Program, measured) -> None:
    simulation = own_program.simulation
    own_program.ask("POST", "/api/episodes", {"label": "killed"})
    time.sleep(1.0)
    os.kill(own_program.pid, signal.SIGKILL)
    killed = time.monotonic()
    eventually(lambda: not _runs(simulation), 2.0)
    gone = time.monotonic() - killed
    (file,) = own_program.recordings.glob("*.mcap")
    assert recordings.recover(file) == 0
    measured(2, f"web process killed: the simulation ends after {1e3 * gone:.0f} ms, the recording recovers")


@pytest.mark.row(2)
@pytest.mark.parametrize("blow", [signal.SIGSTOP, signal.SIGKILL], ids=["stopped", "killed"])
def test_a_simulation_that_dies_or_hangs_is_a_fault_at_once(program: Program, blow: signal.Signals, measured) -> None:
    id = program.ask("POST", "/api/episodes", {"label": blow.name})["id"]
    time.sleep(0.5)
    os.kill(program.simulation, blow)
    hit = time.monotonic()
    eventually(lambda: program.health["state"] == "FAULT", 2.0)
    shown = time.monotonic() - hit
    assert shown <= 0.5
    eventually(lambda: program.health["recording"] is None, 2.0)
    (info,) = [info for info in program.ask("GET", "/api/episodes") if info["id"] == id]
    assert info["ended"] == "stopped"
    program.ask("POST", "/api/reset")
    assert program.health["state"] == "STOPPED"
    measured(2, f"simulation {blow.name}: FAULT shown after {1e3 * shown:.0f} ms")


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False
