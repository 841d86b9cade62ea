"""A headset's packets over a real socket: how soon they count, and that none waits behind another."""

from __future__ import annotations

import asyncio
import json
import socket
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest
import uvicorn
from stand_ins import eventually
from websockets.sync.client import ClientConnection, connect

from app.inputs.operator import Operators
from app.inputs.webxr import Headsets
from app.newest import Newest
from app.outputs.telemetry import Names, Telemetry
from app.protocol import HEADSET, HEADSET_VERSION, Asks, Seen
from app.server import create_app
from app.simulation import Simulation
from robots import catalog

PERIOD = 1 / 60
NECK_PITCH = 34
"""Its place in a command's vector."""
LOOK = 0.5
"""Further down than a robot looks by itself [rad]."""


class Site:
    """A running server that keeps when it wrote which command."""

    def __init__(self, simulation: Simulation) -> None:
        robot, commands = catalog.load("h1"), simulation.exchange.commands
        operators = Operators(commands, simulation.applied)
        self.written: list[tuple[float, float]] = []
        push = commands.push

        def noted(record: np.ndarray) -> None:
            push(record)
            self.written.append((float(record["vector"][NECK_PITCH]), time.monotonic()))

        commands.push = noted
        telemetry = Telemetry(Names("h1", ("none",), 50.0), simulation, operators)
        headsets = Headsets(robot.spec, robot.model("play"), simulation.applied)
        app = create_app(telemetry.health, operators, operators.reset, "127.0.0.1", headset=headsets.join)
        self._server = uvicorn.Server(uvicorn.Config(app, log_level="critical", timeout_graceful_shutdown=1))
        self._door = socket.create_server(("127.0.0.1", 0))
        self.port = self._door.getsockname()[1]
        self._thread = threading.Thread(target=self._server.run, kwargs={"sockets": [self._door]})
        self._thread.start()
        eventually(lambda: self._server.started)

    def operator(self) -> ClientConnection:
        return connect(f"ws://127.0.0.1:{self.port}/api/operator", compression=None, max_queue=None)  # answers pile up unread

    def close(self) -> None:
        self._server.should_exit = True
        self._thread.join()
        self._door.close()


@pytest.fixture
def site(simulation: Simulation) -> Iterator[Site]:
    site = Site(simulation)
    yield site
    site.close()
    del simulation.exchange.commands.push


def packet(pitch: float, now: float) -> bytes:
    """A head that looks down by an angle [rad]; both hands are seen and bend their fingers."""
    row = np.zeros((), HEADSET)
    row["version"], row["time"], row["valid"] = HEADSET_VERSION, now, Seen.HEAD | Seen.LEFT_FINGERS | Seen.RIGHT_FINGERS
    row["asks"] = Asks.NECK | Asks.FINGERS | Asks.LEFT_ARM | Asks.RIGHT_ARM
    row["head"] = [0, 1.6, 0, -np.sin(pitch / 2), 0, 0, np.cos(pitch / 2)]
    finger, joint = np.divmod(np.arange(24), 5)
    row["joints"][:, 1:, 0], row["joints"][:, 1:, 2] = 0.02 * finger, -0.03 * (1 + joint)
    row["joints"][:, 1:, 1] = -0.01 * joint**1.5
    return row.tobytes()


def test_sixty_packets_a_second_each_count_within_twenty_milliseconds(site: Site) -> None:
    """p95 from the headset's send to the command in shared memory, the best of three: machines that run tests are busy."""

    def delay() -> float:
        site.written.clear()
        sent: dict[float, float] = {}
        with site.operator() as client:
            client.send(json.dumps({"seq": 0, "engage": True}))
            client.send(packet(0.0, time.monotonic()))
            eventually(lambda: any(abs(pitch) < 1e-5 for pitch, _ in site.written))
            due = time.monotonic()
            for number in range(1, 121):
                due += PERIOD
                time.sleep(max(0.0, due - time.monotonic()))
                sent[round(LOOK + number / 400, 4)] = time.monotonic()
                client.send(packet(LOOK + number / 400, due))
            eventually(lambda: any(pitch > 0.299 + LOOK for pitch, _ in site.written))
        first: dict[float, float] = {}
        for pitch, at in site.written:
            first.setdefault(round(pitch, 4), at)
        delays = [first[pitch] - at for pitch, at in sent.items() if pitch in first]
        return float(np.percentile(delays, 95)) if len(delays) > 110 else np.inf  # nearly every one became a command of its own

    assert min(delay() for _ in range(3)) < 0.02


def test_packets_that_pile_up_are_skipped_for_the_newest() -> None:
    async def piled() -> tuple[list[int], int]:
        newest, taken = Newest[int](), []

        async def follow() -> None:
            while not taken or taken[-1] < 59:
                taken.append(await newest.take())

        task = asyncio.ensure_future(follow())
        await asyncio.sleep(0)
        newest.put(0)
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        for number in range(1, 60):
            newest.put(number)
        await asyncio.wait_for(task, 5)
        return taken, newest.replaced

    assert asyncio.run(piled()) == ([0, 59], 58)


def test_a_wrong_packet_is_refused_and_told_and_an_honest_one_still_counts(site: Site) -> None:
    with site.operator() as client:
        wrong = np.frombuffer(packet(0.0, 1.0), HEADSET)[0].copy()
        wrong["version"] = 77
        client.send(wrong.tobytes())
        eventually(lambda: "version 1, not 77" in (json.loads(client.recv(timeout=10))["error"] or ""))
        client.send(json.dumps({"seq": 1, "engage": True}))
        client.send(packet(0.0, 2.0))
        client.send(packet(LOOK, 2.1))
        eventually(lambda: any(abs(pitch - LOOK) < 1e-5 for pitch, _ in site.written))
