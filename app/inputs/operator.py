"""Everybody who is connected, who of them drives, and the command that the robot is asked to follow."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app import clock
from app.arbiter import Lease
from app.guard import sane
from app.inputs.merge import Merged
from app.protocol import OperatorMessage
from app.shared import COMMAND, Ring
from policies.command import Command


@dataclass(eq=False)
class Client:
    """One open operator socket."""

    key: str
    name: str
    """What others see."""
    seq: int = -1
    """Of the newest message."""
    error: str | None = None
    """Why a message was refused; nobody told the client yet."""


class Operators:
    """The clients, the lease, and the only writer of the command ring. Safe to call from several threads."""

    def __init__(self, commands: Ring, applied: Callable[[], Command]) -> None:
        """`applied` tells what the robot does now."""
        self._commands, self._applied = commands, applied
        self._lock = threading.Lock()
        self._lease, self._merged = Lease(), Merged()
        self._clients: dict[str, Client] = {}
        self._joined = self._stops = self._resets = self._stamp = 0
        self.rejected = 0
        """Messages that were refused, or a part of them."""

    def join(self) -> Client:
        """A socket opened; it watches."""
        with self._lock:
            self._joined += 1
            client = Client(str(self._joined), f"operator {self._joined}")
            self._clients[client.key] = client
            return client

    def leave(self, client: Client) -> None:
        """A socket closed. If it drove, the robot holds at once."""
        with self._lock:
            del self._clients[client.key]
            if self._lease.leave(client.key):
                self._stamp = 0
                self._write(self._merged.handed_over())

    def hear(self, client: Client, message: OperatorMessage) -> None:
        """A message arrived: a sign of life, and from the driver a command."""
        stamp = clock.nanoseconds()
        with self._lock:
            client.seq, client.name = message.seq, message.name or client.name
            before = self._lease.number
            if not self._lease.hear(client.key, stamp * 1e-9, wants=message.drives, takes=message.take):
                return
            merged = self._merged
            if self._lease.number != before:
                merged = merged.handed_over(engaged=message.take and bool(message.engage))
            self._take(client, merged, message, stamp)

    def refuse(self, client: Client, why: str) -> None:
        """A message was not what app.protocol says: no sign of life, and the client is told."""
        with self._lock:
            self._refuse(client, why)

    def stop(self) -> None:
        """Anybody pressed Stop."""
        with self._lock:
            self._stops += 1
            self._write(self._merged)

    def reset(self) -> None:
        """Anybody pressed Reset."""
        with self._lock:
            self._resets += 1
            self._write(self._merged)

    @property
    def driver(self) -> Client | None:
        """Who holds the lease."""
        with self._lock:
            self._lease.expire(clock.now())
            return self._clients.get(self._lease.holder or "")

    @property
    def count(self) -> int:
        """Open sockets."""
        return len(self._clients)

    def _take(self, client: Client, merged: Merged, message: OperatorMessage, stamp: int) -> None:
        """Write what the driver says; a wrist that is out of bounds keeps its last good target."""
        applied = self._applied()
        new = merged.with_message(message, applied)
        if message.wrists and not sane(new.command.vector()):
            self._refuse(client, "a wrist is out of bounds")
            new = merged.with_message(message.model_copy(update={"wrists": None}), applied)
        if not sane(new.command.vector()):
            self._refuse(client, "a number is out of bounds")
            return
        self._stamp = stamp
        self._write(new)

    def _refuse(self, client: Client, why: str) -> None:
        client.error = why
        self.rejected += 1

    def _write(self, merged: Merged) -> None:
        self._merged = merged
        record = np.zeros((), COMMAND)
        record["stamp"], record["vector"], record["given"] = self._stamp, merged.command.vector(), merged.given
        record["driver"], record["presses"] = self._lease.number, merged.presses
        record["stops"], record["resets"] = self._stops, self._resets
        self._commands.push(record)
