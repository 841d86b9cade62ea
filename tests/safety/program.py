"""The program as its users run it, and an operator without a browser."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from stand_ins import eventually
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from app.mode import Reason
from policies.recording.reader import Recording

PERIOD = 0.05
"""Between two messages of an operator [s]."""


class Program:
    """A `teleop` in processes of its own."""

    def __init__(self, recordings: Path, *arguments: str, **headers: str) -> None:
        """Start it and wait until the robot stands. `headers` go with every request."""
        self.recordings, self.headers = recordings, headers
        self._said = tempfile.TemporaryFile("w+")  # noqa: SIM115 - closed with the program
        command = [sys.executable, "-m", "app", "--port", "0", "--recordings", os.fspath(recordings), *arguments]
        self._process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=self._said, text=True, cwd=Path(__file__).parents[2], start_new_session=True
        )
        assert self._process.stdout is not None
        self.greeting = self._process.stdout.readline()
        found = re.search(r"https?://[^\s/]+:(\d+)", self.greeting)
        assert found, self.said
        self.url, self.port, self.pid = found[0], int(found[1]), self._process.pid

    @property
    def said(self) -> str:
        """Everything on its standard error."""
        self._said.seek(0)
        return self._said.read()

    @property
    def simulation(self) -> int:
        """Process id of the simulation."""
        children = Path(f"/proc/{self.pid}/task").glob("*/children")
        pids = [pid for line in children for pid in line.read_text().split()]
        return next(int(pid) for pid in pids if "spawn_main" in Path(f"/proc/{pid}/cmdline").read_text())

    @property
    def alive(self) -> bool:
        return self._process.poll() is None

    @property
    def health(self) -> dict[str, Any]:
        return self.ask("GET", "/api/health")

    def ask(self, method: str, path: str, body: Any = None) -> Any:
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.url + path, data, {"Content-Type": "application/json"} | self.headers, method=method)
        with urllib.request.urlopen(request, timeout=30) as answer:
            text = answer.read()
        return json.loads(text) if text and "json" in answer.headers["content-type"] else text

    def socket(self, path: str, port: int | None = None, **options: Any) -> ClientConnection:
        """A WebSocket to the program, or to it through the port of a proxy."""
        address = f"ws://127.0.0.1:{port or self.port}{path}"
        return connect(address, compression=None, max_size=None, additional_headers=self.headers, **options)

    def home(self) -> None:
        """Nobody drives and the robot stands at home."""
        eventually(lambda: self.health["driver"] is None)
        self.ask("POST", "/api/reset")
        eventually(lambda: self.health["state"] == "STOPPED")
        time.sleep(0.5)

    @contextmanager
    def recorded(self) -> Iterator[list[np.ndarray]]:
        """Record what happens inside; afterwards the list holds its rows (policies.episode.row_dtype)."""
        rows: list[np.ndarray] = []
        id = self.ask("POST", "/api/episodes", {"label": "safety"})["id"]
        try:
            yield rows
        finally:
            self.ask("POST", f"/api/episodes/{id}/stop", {})
        with tempfile.NamedTemporaryFile(suffix=".mcap") as file:
            file.write(self.ask("GET", f"/api/episodes/{id}/download"))
            file.flush()
            with Recording(Path(file.name)) as recording:
                (episode,) = recording.episodes()
        assert episode.info.gaps == 0
        rows.append(episode.rows)

    def kill(self) -> None:
        """All of it, with kill -9."""
        os.killpg(self.pid, signal.SIGKILL)
        self._process.wait()

    def close(self) -> None:
        if self.alive:
            os.kill(self.pid, signal.SIGCONT)
            self._process.terminate()
            self._process.wait(20)
        assert self._process.stdout is not None
        self._process.stdout.close()
        self._said.close()


class Operator:
    """Sends the same fields every 50 ms, as a page does, each message with another velocity to tell it from the others."""

    def __init__(self, program: Program, port: int | None = None, persistent: bool = False, **fields: Any) -> None:
        """A `persistent` one presses again when a machine that is busy kept it from speaking for 200 ms."""
        self.fields, self.answers, self._persistent = fields, [], persistent
        self._going, self._seq = True, 0
        self.twist = fields.pop("twist", {"vx": 0.5})
        self._socket = program.socket("/api/operator", port)
        self._threads = [threading.Thread(target=work, daemon=True) for work in (self._speak, self._listen)]
        for thread in self._threads:
            thread.start()

    @property
    def state(self) -> str:
        return self.answers[-1]["state"] if self.answers else ""

    def engage(self) -> None:
        """Press and hold Engage until the robot follows; a machine that is busy may need several presses."""

        def follows() -> bool:
            self.fields["engage"] = False
            time.sleep(0.15)
            self.fields["engage"] = True
            time.sleep(0.25)
            newest = self.answers[-1]
            return bool(newest["drives"]) and all(newest["roles"][role]["state"] == "ENGAGED" for role in newest["drives"])

        eventually(follows, 30)

    def say(self, text: str) -> None:
        """Send something else in between."""
        self._socket.send(text)

    def silence(self) -> None:
        """Say nothing any more; the socket stays open."""
        self._going = False
        self._threads[0].join()

    def vanish(self) -> None:
        """The connection is reset, without a good-bye."""
        self._going = False
        self._socket.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self._socket.socket.close()

    def close(self) -> None:
        self._going = False
        with suppress(OSError):
            self._socket.close()
        for thread in self._threads:
            thread.join(5)

    def _speak(self) -> None:
        pressed = False
        try:
            while self._going:
                self._seq += 1
                twist = {**self.twist, "vx": self.twist["vx"] + 1e-9 * self._seq}
                lost = self._persistent and self.answers and self.answers[-1]["reason"] == Reason.SILENT.sentence
                message = {"seq": self._seq, "twist": twist, **self.fields}
                if lost and pressed:
                    message["engage"] = False  # and with the next message it presses again
                pressed = message.get("engage", False)
                self._socket.send(json.dumps(message))
                time.sleep(PERIOD)
        except (ConnectionClosed, OSError):
            pass

    def _listen(self) -> None:
        try:
            for answer in self._socket:
                self.answers.append(json.loads(answer))
        except (ConnectionClosed, OSError):
            pass


@contextmanager
def operator(program: Program, port: int | None = None, persistent: bool = False, **fields: Any) -> Iterator[Operator]:
    """Somebody who drives."""
    someone = Operator(program, port, persistent, **fields)
    try:
        yield someone
    finally:
        someone.close()


def since_last_message(rows: np.ndarray) -> tuple[float, float, float]:
    """From the arrival of the newest message in the rows: seconds until HOLD, until no velocity, and the longest tick between."""
    said = int(np.flatnonzero(np.diff(rows["raw"][:, 1]))[-1]) + 1 if np.diff(rows["raw"][:, 1]).any() else 0
    held = said + int(np.flatnonzero(rows["mode"][said:] == 1)[0])
    stood = held + int(np.flatnonzero(~rows["applied"][held:, 1:4].any(axis=1))[0])
    arrived = rows["wall"][said] - rows["latency"][said, 0] * 1e-3
    longest = float(np.diff(rows["wall"][said : stood + 1]).max(initial=0.02))
    return float(rows["wall"][held] - arrived), float(rows["wall"][stood] - arrived), longest
