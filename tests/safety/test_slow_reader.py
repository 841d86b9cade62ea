"""A client that connects and never reads again."""

from __future__ import annotations

import contextlib
import socket
import time
from pathlib import Path

import pytest
from program import Program
from test_hostile import SOCKETS, frame, opened


def memory(pid: int) -> float:
    """What a process holds for itself [MB]."""
    lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    return sum(int(line.split()[1]) for line in lines if line.startswith(("Private_Clean", "Private_Dirty"))) / 1024


def stall(program: Program, path: str) -> socket.socket:
    """Connected and deaf; at the robot's picture it asked for 100 poses."""
    raw = opened(program, path)
    raw.sendall(frame(1, b"next") * 100 if path == "/api/scene" else b"")
    return raw


def served(program: Program, raw: socket.socket) -> bool:
    """Whether the program still holds its end of the connection."""
    ports = f":{program.port:04X}", f":{raw.getsockname()[1]:04X}"
    lines = (line.split() for line in Path("/proc/net/tcp").read_text().splitlines())
    return any(line[1].endswith(ports[0]) and line[2].endswith(ports[1]) and line[3] == "01" for line in lines)


@pytest.mark.row(10)
@pytest.mark.parametrize("seconds", [3, pytest.param(60, marks=pytest.mark.slow)])
def test_who_does_not_read_costs_nothing(program: Program, seconds: float, measured) -> None:
    with contextlib.ExitStack() as stack:
        with program.socket("/", subprotocols=["viser-v1.1.1"]) as first:
            first.recv()  # the scene is packed when the first page asks for it
        quiet, before = program.health, memory(program.pid)
        stalled = {path: stack.enter_context(stall(program, path)) for path in SOCKETS}
        time.sleep(seconds)
        after, health = memory(program.pid), program.health
        closed = [path for path, raw in stalled.items() if not served(program, raw)]
    assert after - before < 10
    assert health["upright"]
    ticks, missed = health["ticks"] - quiet["ticks"], health["missed"] - quiet["missed"]
    assert missed <= 0.02 * ticks
    if seconds > 30:
        assert closed == list(SOCKETS), "where nothing was owed, because no ping was answered"
    p99 = f"lateness p99 {quiet['lateness_ms']['p99']:.2f} -> {health['lateness_ms']['p99']:.2f} ms"
    told = f"{missed} of {ticks} ticks missed; closed: {' and '.join(closed) or 'none yet'}"
    measured(10, f"a client deaf at each of {len(SOCKETS)} sockets for {seconds} s: {after - before:+.1f} MB, {p99}, {told}")
