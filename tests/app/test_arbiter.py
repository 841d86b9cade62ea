"""One driver a role at a time, whatever the clients do and in whatever order; what changes hands holds in between."""

from __future__ import annotations

from unittest import mock

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule
from test_guard import HOME, standing

from app import clock
from app.arbiter import ROLES, SILENCE, Lease
from app.guard import Guard, ask_from
from app.inputs.operator import Client, Operators
from app.mode import Mode
from app.protocol import OperatorMessage
from app.shared import COMMAND, Memory, Ring
from policies.command import Command

NAMES = ("ada", "bo", "cy")
clients = st.sampled_from(NAMES)
wanted = st.sampled_from([None, [], ["arms"], ["legs"], ["arms", "legs"]])


def test_a_lease_is_one_clients_until_it_leaves_or_falls_silent() -> None:
    lease = Lease()
    assert lease.hear("ada", 0.0, wants=True)
    assert not lease.hear("bo", 0.1, wants=True)
    assert not lease.expire(SILENCE)
    assert lease.expire(SILENCE + 0.1)
    assert lease.hear("bo", SILENCE + 0.2, wants=True)
    assert lease.leave("bo")
    assert (lease.holder, lease.number) == (None, 2)


class Crew(RuleBasedStateMachine):
    """Three clients who speak, take, ask, give, leave and fall silent in front of a real guard.

    Each one asks for numbers of its own, so that whose word the robot follows can be read off.
    """

    def __init__(self) -> None:
        super().__init__()
        self.now, self.seq = 100.0, 0
        self.patch = mock.patch.object(clock, "nanoseconds", side_effect=lambda: round(self.now * 1e9))
        self.patch.start()
        self.ring = Ring(Memory().map(Ring.size(COMMAND, 8)), COMMAND, 8)
        self.operators = Operators(self.ring, lambda: self.guard.limiter.applied)
        self.guard = Guard(HOME, 1.0, 0.02)
        self.clients = {name: self.operators.join() for name in NAMES}
        self.engage = dict.fromkeys(NAMES, False)
        self.drove = dict(self.operators.drivers)

    def teardown(self) -> None:
        self.patch.stop()

    @rule(seconds=st.sampled_from([0.01, 0.1, 0.25, 1.0, 2.5]))
    def time_passes(self, seconds: float) -> None:
        self.now += seconds
        self.tick()

    @rule(name=clients, engage=st.booleans(), roles=wanted, take=st.booleans(), ask=st.booleans(), give=st.one_of(st.none(), clients))
    def speaks(self, name: str, engage: bool, roles: list | None, take: bool, ask: bool, give: str | None) -> None:
        number = 0.1 * (NAMES.index(name) + 1)
        pose = {"position": [0.2, 0.3, number], "quaternion": [1, 0, 0, 0]}
        fields = {"twist": {"vx": number}, "wrists": {"left": pose, "right": pose}} if engage else {}
        self.seq += 1
        message = {"seq": self.seq, "engage": engage, "roles": roles, "take": take, "ask": ask, **fields}
        self.operators.hear(self.clients[name], OperatorMessage.model_validate(message | {"give": give and self.clients[give].key}))
        fresh, self.engage[name] = engage and not self.engage[name], engage
        self.tick(pressed=self.clients[name] if fresh else None)

    @rule(name=clients)
    def leaves_and_comes_back(self, name: str) -> None:
        self.operators.leave(self.clients[name])
        self.tick()
        self.clients[name], self.engage[name] = self.operators.join(), False

    @rule()
    def anyone_stops(self) -> None:
        self.operators.stop()
        self.tick()
        assert self.guard.mode == Mode.STOPPED

    def tick(self, pressed: Client | None = None) -> None:
        """The robot's next tick. What changed hands since the last one holds in it, and only a fresh press engages."""
        before, drove = list(self.guard.modes), self.drove
        self.drove = dict(self.operators.drivers)
        ask = ask_from(self.ring.newest(), self.ring.count)
        self.guard.step(self.now, ask, standing())
        for i, role in enumerate(ROLES):
            if drove[role] is not self.drove[role] and before[i] == Mode.ENGAGED:
                assert self.guard.modes[i] != Mode.ENGAGED, "a hand-over passes through HOLD"
            if before[i] != Mode.ENGAGED and self.guard.modes[i] == Mode.ENGAGED:
                assert pressed is self.drove[role], "only its driver's fresh press engages"

    @invariant()
    def a_role_has_one_writer_and_it_is_its_driver(self) -> None:
        newest = self.ring.newest()
        if newest is None:
            return
        command = Command.from_vector(newest["vector"])
        for role, driver in self.drove.items():
            if self.guard.modes[ROLES.index(role)] != Mode.ENGAGED:
                continue
            assert driver, "nobody is followed who does not drive"
            number = 0.1 * (self.named(driver) + 1)
            said = command.twist[:1] if role == "legs" else command.wrists[:, 2]
            np.testing.assert_allclose(said, number, err_msg=f"{role} hear somebody else")

    @invariant()
    def nobody_is_followed_without_engage(self) -> None:
        for i, role in enumerate(ROLES):
            if self.guard.modes[i] == Mode.ENGAGED:
                driver = self.drove[role]
                assert driver
                assert self.engage[NAMES[self.named(driver)]]

    def named(self, driver: Client) -> int:
        return list(self.clients.values()).index(driver)


TestCrew = pytest.mark.row(11)(Crew.TestCase)
TestCrew.settings = settings(max_examples=60, stateful_step_count=30, deadline=None)
