"""Everybody who is connected, who of them drives what, and the command that the robot is asked to follow."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from app import clock
from app.arbiter import ROLES, Lease, Role
from app.guard import sane
from app.inputs.merge import Merged, combined
from app.protocol import OperatorMessage, PageTiming
from app.shared import COMMAND, Ring
from policies.command import Command


@dataclass(eq=False)
class Client:
    """One open operator socket, or a source of this program."""

    key: str
    name: str
    """What others see."""
    seq: int = -1
    """Of the newest message."""
    roles: tuple[Role, ...] = ROLES
    """What it drives, or would."""
    asks: bool = False
    """It would like what others drive of that."""
    engage: bool = False
    """Its Engage is held."""
    timing: PageTiming = field(default_factory=PageTiming)
    """What its page told of that."""
    heard: float = 0.0
    """When the newest message came, monotonic [s]."""
    error: str | None = None
    """Why a message was refused; nobody told the client yet."""

    def says(self, message: OperatorMessage, now: float) -> None:
        """Keep what the message says about the client itself."""
        self.heard, self.timing = now, message.timing or self.timing
        self.seq, self.name, self.asks = message.seq, message.name or self.name, message.ask
        self.roles = self.roles if message.roles is None else tuple(message.roles)
        self.engage = self.engage if message.engage is None else message.engage


@dataclass
class Seat:
    """A role: whose it is, and the newest that they ask of it."""

    merged: Merged
    lease: Lease = field(default_factory=Lease)
    stamp: int = 0
    """When the driver's newest message arrived, monotonic [ns]; 0: nobody drives."""

    def hand_over(self, engaged: bool = False) -> None:
        """Another driver begins, whose Engage may be held already."""
        self.merged = self.merged.handed_over(engaged)

    def vacate(self) -> None:
        """Nobody drives any more."""
        self.hand_over()
        self.stamp = 0


class Operators:
    """The clients, a lease for each role, and the only writer of the command ring. Safe to call from several threads."""

    def __init__(self, commands: Ring, applied: Callable[[], Command]) -> None:
        """`applied` tells what the robot does now."""
        self._commands, self._applied = commands, applied
        self._lock = threading.Lock()
        self._seats: dict[Role, Seat] = {role: Seat(Merged(role)) for role in ROLES}
        self._clients: dict[str, Client] = {}
        self._joined = self._stops = self._resets = self._policy = 0
        self.seed = 0
        """Of the newest reset; 0: home."""
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
        """A socket closed. What it drove holds at once."""
        with self._lock:
            del self._clients[client.key]
            if self._leave(client, ROLES):
                self._write()

    def hear(self, client: Client, message: OperatorMessage) -> None:
        """A message arrived: a sign of life, and from a driver a command."""
        stamp = clock.nanoseconds()
        with self._lock:
            held = client.engage
            client.says(message, stamp * 1e-9)
            changed = self._expire(stamp * 1e-9)
            if message.give:
                changed |= self._give(client, message.give, stamp)
            changed |= self._leave(client, tuple(role for role in ROLES if role not in client.roles))
            driven: list[Role] = [role for role in client.roles if self._drives(role, client, message, stamp * 1e-9, held)]
            if changed:
                self._write()
            if driven:
                self._take(client, driven, message, stamp)

    def refuse(self, client: Client, why: str) -> None:
        """A message was not what app.protocol says: no sign of life, and the client is told."""
        with self._lock:
            self._refuse(client, why)

    def stop(self) -> None:
        """Anybody pressed Stop."""
        with self._lock:
            self._stops += 1
            self._write()

    def reset(self, seed: int = 0) -> None:
        """Somebody who may pressed Reset; a seed other than 0 varies where the robot stands then."""
        with self._lock:
            self._resets += 1
            self.seed = seed
            self._write()

    def choose(self, policy: int) -> None:
        """Walk with other leg weights: an index into the names that the simulation was started with."""
        with self._lock:
            self._policy = policy
            self._write()

    @property
    def drivers(self) -> dict[Role, Client | None]:
        """Who holds the lease of each role."""
        with self._lock:
            if self._expire(clock.now()):
                self._write()
            return {role: self._clients.get(self._seats[role].lease.holder or "") for role in ROLES}

    @property
    def clients(self) -> list[Client]:
        """Everybody who is connected, in the order in which they came."""
        with self._lock:
            return list(self._clients.values())

    def _drives(self, role: Role, client: Client, message: OperatorMessage, now: float, held: bool) -> bool:
        """Whether the message's client drives the role from here on. An Engage that was held before is no fresh press."""
        seat = self._seats[role]
        number = seat.lease.number
        drives = seat.lease.hear(client.key, now, wants=message.drives, takes=message.take)
        if seat.lease.number != number:
            seat.hand_over(engaged=held or (message.take and client.engage))
        return drives

    def _give(self, client: Client, key: str, stamp: int) -> bool:
        """Hand what the client drives and another one wants to that one. Returns whether there was such."""
        other = self._clients.get(key, client)
        given = [self._seats[role] for role in other.roles if other is not client and self._seats[role].lease.holder == client.key]
        for seat in given:
            seat.lease.give(key, stamp * 1e-9)
            seat.hand_over(other.engage)
            seat.stamp = stamp
        return bool(given)

    def _leave(self, client: Client, roles: tuple[Role, ...]) -> bool:
        """Free these roles if the client has them. Returns whether it had one."""
        left = [self._seats[role] for role in roles if self._seats[role].lease.leave(client.key)]
        for seat in left:
            seat.vacate()
        return bool(left)

    def _expire(self, now: float) -> bool:
        """Free the roles of drivers who fell silent. Returns whether there was one."""
        expired = [seat for seat in self._seats.values() if seat.lease.expire(now)]
        for seat in expired:
            seat.vacate()
        return bool(expired)

    def _take(self, client: Client, driven: list[Role], message: OperatorMessage, stamp: int) -> None:
        """Write what the driver says; a wrist that is out of bounds keeps its last good target."""
        new = self._heard(driven, message)
        if message.wrists and not sane(_command(new).vector()):
            self._refuse(client, "a wrist is out of bounds")
            new = self._heard(driven, message.model_copy(update={"wrists": None}))
        if not sane(_command(new).vector()):
            self._refuse(client, "a number is out of bounds")
            return
        for role in driven:
            self._seats[role].merged, self._seats[role].stamp = new[role], stamp
        self._write()

    def _heard(self, driven: list[Role], message: OperatorMessage) -> dict[Role, Merged]:
        """Everybody's part, with the message in those that its client drives."""
        applied, parts = self._applied(), self._parts
        for role in driven:
            parts[role] = parts[role].with_message(message, applied)
        return parts

    @property
    def _parts(self) -> dict[Role, Merged]:
        """What everybody asks."""
        return {role: self._seats[role].merged for role in ROLES}

    def _refuse(self, client: Client, why: str) -> None:
        client.error = why
        self.rejected += 1

    def _write(self) -> None:
        seats, parts, record = self._seats.values(), self._parts, np.zeros((), COMMAND)
        record["stamp"], record["driver"] = [seat.stamp for seat in seats], [seat.lease.number for seat in seats]
        record["engage"] = [part.command.engage for part in parts.values()]
        record["presses"] = [part.presses for part in parts.values()]
        record["vector"], record["given"] = _command(parts).vector(), parts["arms"].given
        record["smooth"] = parts["arms"].smooth
        record["stops"], record["resets"], record["seed"] = self._stops, self._resets, self.seed
        record["policy"] = self._policy
        self._commands.push(record)


def _command(parts: dict[Role, Merged]) -> Command:
    return combined(parts["arms"].command, parts["legs"].command)
