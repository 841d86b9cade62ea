"""Clients that send rubbish, too much or too fast, while the robot stands or walks."""

from __future__ import annotations

import json
import random
import socket
import struct
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

import numpy as np
import pytest
from program import Program, operator
from stand_ins import eventually
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection

from app.guard import sane
from app.limiter import WRIST_SPEED, WRIST_TURN
from app.traffic import LARGEST_BODY, LARGEST_MESSAGE

SOCKETS = ("/", "/api/scene", "/api/operator")
NUMBERS = (0.0, 1.0, -1.0, 0.3, 1e30, -1e308, float("nan"), float("inf"), float("-inf"), 1e-320, 2**60, None, "1", True, [], {})
TOLD = {"NaN", "Infinity", "-Infinity"}


LEASES = ("engage", "take", "roles", "ask", "give")


def fuzzed(dice: random.Random, seq: int, without: tuple[str, ...] = ()) -> str:
    """An operator's message with anything in its fields, `without` some; about half of them are honest in most fields."""
    number = lambda: dice.uniform(-1.2, 1.2) if dice.random() < 0.7 else dice.choice(NUMBERS)  # noqa: E731

    def pose() -> Any:
        position = [number() for _ in range(dice.choice((3, 3, 3, 3, 2, 4)))]
        turn = np.array([dice.gauss(0, 1) for _ in range(4)])
        quaternion = (turn / np.linalg.norm(turn)).tolist() if dice.random() < 0.7 else [number() for _ in range(4)]
        return {"position": position, "quaternion": quaternion}

    fields = {
        "engage": lambda: dice.choice((True, False, True, None, "yes")),
        "twist": lambda: {name: number() for name in ("vx", "vy", "yaw_rate")},
        "height": number,
        "roll": number,
        "pitch": number,
        "wrists": lambda: {"left": pose(), "right": pose()},
        "hands": lambda: {"left": [number() for _ in range(6)]},
        "neck": lambda: {"yaw": number(), "pitch": number()},
        "waist": number,
        "take": lambda: dice.choice((True, False, 3)),
        "roles": lambda: dice.choice((["arms"], ["legs"], ["arms", "legs"], [], ["head"], ["arms"] * 9)),
        "ask": lambda: dice.choice((True, False, "x")),
        "give": lambda: dice.choice(("1", "2", "nobody", "", 5)),
        "name": lambda: dice.choice(("ada", "", "x" * 50, "\u202e<b>", None)),
        "unknown": number,
    }
    chosen = dice.sample([name for name in fields if name not in without], dice.choice((1, 1, 2, 3, 6)))
    return json.dumps({"seq": dice.choice((seq, seq, seq, -1, 2**60, "1")), **{name: fields[name]() for name in chosen}})


def send_all(program: Program, messages: list[str]) -> None:
    """As fast as a client may, reading the answers."""
    with program.socket("/api/operator") as client:
        listener = threading.Thread(target=drain, args=(client,), daemon=True)
        listener.start()
        for message in messages:
            client.send(message)
            time.sleep(1 / 180)
        time.sleep(0.2)
    listener.join()


def drain(client: ClientConnection) -> None:
    """Read until it closes."""
    with suppress(ConnectionClosed):
        for _ in client:
            pass


@pytest.mark.row(4)
@pytest.mark.parametrize(("others", "own"), [(1600, 200), pytest.param(8000, 2000, marks=pytest.mark.slow)])
def test_fuzzed_messages_never_reach_the_robot(program: Program, others: int, own: int, measured) -> None:
    """From eight clients that take the robot from each other, then between the honest messages of one who drives."""
    dice, clients, before = random.Random(others), 8, program.health["rejected"]
    messages = [[fuzzed(dice, seq) for seq in range(others // clients)] for _ in range(clients)]
    with program.recorded() as recorded:
        threads = [threading.Thread(target=send_all, args=(program, mine)) for mine in messages]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        with operator(program, persistent=True) as driver:
            driver.engage()
            for seq in range(own):
                driver.say(fuzzed(dice, seq, without=LEASES))
                time.sleep(1 / 130)
    health, rows = program.health, recorded[0]
    rejected, engaged = health["rejected"] - before, int((rows["mode"] == 2).sum())
    assert rejected > (others + own) / 10
    assert engaged > own / 130 * 50 / 2
    assert all(sane(vector) for vector in rows["raw"])
    assert all(sane(vector) for vector in rows["applied"])
    assert np.isfinite(rows["ctrl"]).all()
    assert np.unique(rows["raw"], axis=0).shape[0] > own / 4, "honest fields among them got through"
    assert health["upright"]
    assert "Traceback" not in program.said
    seen = f"0 of {len(rows)} ticks ({engaged} engaged) saw a bad one"
    measured(4, f"{others + own} fuzzed messages: {rejected} refused in part or whole, {seen}, upright, 0 tracebacks")


@pytest.mark.row(5)
@pytest.mark.parametrize(("jump", "lets_go"), [(0.2, False), (0.9, True)], ids=["within reach of a hand", "across the room"])
def test_targets_that_jump_move_the_wrists_slowly_or_not_at_all(program: Program, jump: float, lets_go: bool, measured) -> None:
    dice, told = random.Random(5), False
    with operator(program, persistent=True) as driver:
        driver.engage()
        home = {side: driver.answers[-1]["wrists"][side]["actual"] for side in ("left", "right")}
        with program.recorded() as recorded:
            for _ in range(60):
                driver.fields["wrists"] = {
                    side: {**pose, "position": [x + jump * dice.choice((-0.5, 0.5)) / 3**0.5 for x in pose["position"]]}
                    for side, pose in home.items()
                }
                time.sleep(0.05)
                told |= driver.answers[-1]["wrists"]["left"]["let_go"]
    fastest, turning = wrist_speeds(recorded[0])
    assert (recorded[0]["mode"] == 2).mean() > 0.5
    assert 0 < fastest <= WRIST_SPEED + 1e-6
    assert turning <= WRIST_TURN + 1e-3
    assert told == lets_go
    does = "lets go and says so" if told else "follows"
    measured(5, f"20 targets a second, {jump} m apart: {does}; wrists commanded at {fastest:.2f} m/s at most ({len(recorded[0])} ticks)")


def wrist_speeds(rows: np.ndarray) -> tuple[float, float]:
    """The fastest that the wrists' commands moved and turned between two ticks that follow each other [m/s], [rad/s]."""
    wrists = rows["applied"][:, 7:21].reshape(-1, 2, 7)
    steady = ~rows["jump"][1:].astype(bool)
    moved = np.linalg.norm(np.diff(wrists[..., :3], axis=0), axis=-1)[steady]
    cosine = np.abs((wrists[1:, :, 3:] * wrists[:-1, :, 3:]).sum(-1)).clip(max=1)[steady]
    return float(moved.max()) * 50, float(2 * np.arccos(cosine).max()) * 50


def malformed(dice: random.Random) -> bytes:
    """A frame, or what looks like one, as a client puts it on the wire."""
    kind = dice.randrange(9)
    payload = dice.randbytes(dice.choice((0, 1, 7, 125)))
    if kind == 0:
        return dice.randbytes(dice.randint(1, 200))
    if kind == 1:
        return frame(1, b"\xff\xfe" + payload)  # no UTF-8
    if kind == 2:
        return frame(dice.choice((3, 5, 7, 11, 15)), payload)  # no such opcode
    if kind == 3:
        return frame(1, b"{}", masked=False)
    if kind == 4:
        return frame(1, b"{", reserved=0x40)
    if kind == 5:
        return frame(9, b"x" * 126)  # a control frame is shorter
    if kind == 6:
        return frame(2, payload)  # binary
    if kind == 7:
        return frame(1, dice.choice((b"", b"{", b"[1]", b"nul", b'"x"', b'{"seq":', b"[" * 5000)))
    return frame(0, payload)  # goes on with nothing


def frame(opcode: int, payload: bytes, masked: bool = True, reserved: int = 0) -> bytes:
    """A WebSocket frame (RFC 6455, section 5.2) with a mask of zeros."""
    bit, size = 0x80 * masked, len(payload)
    length = bytes([bit | size]) if size < 126 else struct.pack("!BH", bit | 126, size)
    return bytes([0x80 | reserved | opcode]) + length + (bytes(4) if masked else b"") + payload


def opened(program: Program, path: str) -> socket.socket:
    """A socket after its handshake."""
    raw = socket.create_connection(("127.0.0.1", program.port), timeout=10)
    raw.sendall(
        f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{program.port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        f"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: viser-v1.1.1\r\n\r\n".encode()
    )
    said = b""
    while b"\r\n\r\n" not in said:
        said += raw.recv(1)
    assert b" 101 " in said
    return raw


def closing_code(raw: socket.socket) -> int | None:
    """The code of the close frame that the server sends; None when it only hangs up. Reads past other frames."""
    data = b""
    with suppress(OSError):
        while piece := raw.recv(65536):
            data += piece
            while len(data) >= 2:
                size, start = data[1] & 0x7F, 2
                if size >= 126:
                    start = 4 if size == 126 else 10
                    size = int.from_bytes(data[2:start], "big") if len(data) >= start else 1 << 62
                if len(data) < start + size:
                    break
                if data[0] & 0x0F == 8:
                    return int.from_bytes(data[start : start + 2], "big")
                data = data[start + size :]
    return None


@pytest.mark.row(15)
@pytest.mark.parametrize("count", [200, pytest.param(5000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("path", ["/api/operator", "/api/scene"])
def test_malformed_frames_close_the_socket_and_nothing_else(program: Program, path: str, count: int, measured) -> None:
    dice, codes = random.Random(count), Counter()
    for _ in range(count):
        with opened(program, path) as raw:
            with suppress(OSError):
                raw.sendall(malformed(dice))
                raw.shutdown(socket.SHUT_WR)
            codes[closing_code(raw)] += 1
    assert set(codes) <= {1002, 1003, 1007, 1009, None, 1000, 1005}, codes
    eventually(lambda: program.health["clients"] == 0)
    health = program.health
    assert (health["state"], health["upright"]) == ("STOPPED", True)
    assert "Traceback" not in program.said
    told = ", ".join(f"{code or 'hung up'}: {times}" for code, times in codes.most_common())
    measured(15, f"WS {path}: {count} malformed frames: closed with {told}; 0 tracebacks")


@pytest.mark.row(16)
@pytest.mark.parametrize("path", SOCKETS)
def test_a_message_of_more_than_64_kib_is_refused_on_every_socket(program: Program, path: str, measured) -> None:
    for size in (LARGEST_MESSAGE + 1, 20_000_000, 1 << 62):
        with opened(program, path) as raw:
            raw.sendall(bytes([0x81, 0xFF]) + struct.pack("!Q", size) + bytes(4))  # the head of a frame tells its size
            assert closing_code(raw) == 1009
    measured(16, f"WS {path}: {LARGEST_MESSAGE + 1} bytes closed with 1009")


@pytest.mark.row(16)
def test_a_body_of_more_than_1_mib_is_refused_before_it_is_read(program: Program, measured) -> None:
    for path in ("/api/episodes", "/api/stop", "/api/reset"):
        with socket.create_connection(("127.0.0.1", program.port), timeout=10) as raw:
            head = f"POST {path} HTTP/1.1\r\nHost: 127.0.0.1:{program.port}\r\nContent-Type: application/json\r\n"
            raw.sendall(f"{head}Content-Length: {LARGEST_BODY + 1}\r\n\r\n".encode())
            assert raw.recv(100).startswith(b"HTTP/1.1 413")
    pieces = iter([b" " * 1024] * (LARGEST_BODY // 1024) + [b"{}"])  # tells no length
    endless = urllib.request.Request(program.url + "/api/episodes", pieces, {"Content-Type": "application/json"}, method="POST")
    with pytest.raises(urllib.error.HTTPError, match="413") as refused:
        urllib.request.urlopen(endless, timeout=10)
    refused.value.close()
    assert program.health["recording"] is None
    measured(16, f"{LARGEST_BODY + 1} bytes of body: 413, with a length or without")


FLOOD = """
import asyncio, sys
from websockets.asyncio.client import connect
from websockets.exceptions import WebSocketException

async def one(address, rate, payload):
    while True:
        try:
            async with connect(address, compression=None) as socket:
                while True:
                    for _ in range(max(1, int(rate) // 50)):
                        await socket.send(payload)
                    await asyncio.sleep(max(1, int(rate) // 50) / rate)
        except (OSError, WebSocketException) as error:
            print(getattr(getattr(error, "rcvd", None), "code", 0), flush=True)
            await asyncio.sleep(0.1)

async def main(address, payload, *rates):
    await asyncio.gather(*(one(address, float(rate), payload) for rate in rates))

asyncio.run(main(*sys.argv[1:]))
"""
"""Clients that send the same thing at a rate each [1/s], never read, and come back when they are closed; prints the codes."""


@contextmanager
def flood(program: Program, *rates: int) -> Iterator[Counter]:
    """From a process of its own; the counter tells afterwards with what codes clients were closed."""
    payload = {"seq": 1, "twist": {"vx": 0.1}, "wrists": {"left": {"position": [0.3, 0.2, 0.1], "quaternion": [1, 0, 0, 0]}}}
    command = [sys.executable, "-c", FLOOD, f"ws://127.0.0.1:{program.port}/api/operator", json.dumps(payload), *map(str, rates)]
    codes = Counter()
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        eventually(lambda: program.health["clients"] > len(rates) / 2)
        try:
            yield codes
        finally:
            process.kill()
            codes.update(process.communicate()[0].split())


@pytest.mark.row(17)
def test_stop_works_within_100_ms_during_a_flood(program: Program, measured) -> None:
    pressed, rates = [], [190] * 4 + [1000] * 2
    with operator(program, persistent=True) as driver, program.recorded() as recorded, flood(program, *rates) as codes:
        for _ in range(7):
            driver.engage()
            pressed.append(time.time())
            program.ask("POST", "/api/stop")
            eventually(lambda: driver.state == "STOPPED")
    rows = recorded[0]
    delays = 1e3 * np.array([rows["wall"][(rows["wall"] > at) & (rows["mode"] == 0)][0] - at for at in pressed])
    assert np.median(delays) <= 100, "not every one on a machine that is busy with other things too"
    assert codes["1008"] > 0
    assert program.health["upright"]
    told = f"after {np.median(delays):.0f} ms (median), {delays.max():.0f} ms at most"
    measured(17, f"clients at {rates} messages/s, {codes['1008']} times closed with 1008: Stop {told}")


@pytest.mark.row(17)
@pytest.mark.parametrize("path", SOCKETS)
def test_who_sends_more_than_200_messages_a_second_is_closed(program: Program, path: str, measured) -> None:
    with opened(program, path) as raw:
        with suppress(OSError):
            raw.sendall(frame(1, b'{"seq": 1}') * 1000)
        assert closing_code(raw) == 1008
    measured(17, f"WS {path}: 1000 messages at once closed with 1008")


@pytest.mark.row(17)
@pytest.mark.parametrize("path", SOCKETS)
def test_the_seventeenth_socket_is_told_that_it_is_one_too_many(program: Program, path: str, measured) -> None:
    with ExitStack() as stack:
        for _ in range(16):
            stack.enter_context(opened(program, path))
        with opened(program, path) as one_more:
            assert closing_code(one_more) == 1013
    measured(17, f"WS {path}: the 17th socket closed with 1013")
    eventually(lambda: program.health["clients"] == 0)
