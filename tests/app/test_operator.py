"""Clients, lease and merging: what stands in shared memory after what was said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.inputs import operator as module
from app.inputs.operator import Client, Operators
from app.protocol import OperatorMessage
from app.shared import COMMAND, Memory, Ring
from policies.command import Command

POSE = {"position": [0.3, 0.2, 0.1], "quaternion": [1, 0, 0, 0]}
FOLLOWED = replace(Command(), height=0.93, wrists=np.array([[0.2, 0.3, 0, 1, 0, 0, 0], [0.2, -0.3, 0, 1, 0, 0, 0]]))


class Desk:
    """Operators over a ring, with a clock that tests move."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 50.0
        monkeypatch.setattr(module.clock, "nanoseconds", lambda: round(self.now * 1e9))
        self.ring = Ring(Memory().map(Ring.size(COMMAND, 8)), COMMAND, 8)
        self.operators = Operators(self.ring, lambda: FOLLOWED)

    def say(self, client: Client, **fields) -> None:
        self.operators.hear(client, OperatorMessage.model_validate({"seq": client.seq + 1, **fields}))

    @property
    def drivers(self) -> list[Client | None]:
        """Of arms and legs."""
        return list(self.operators.drivers.values())

    @property
    def record(self) -> np.void:
        return self.ring.newest()

    @property
    def command(self) -> Command:
        return Command.from_vector(self.record["vector"])


@pytest.fixture
def desk(monkeypatch: pytest.MonkeyPatch) -> Desk:
    return Desk(monkeypatch)


def test_of_every_field_the_newest_counts(desk: Desk) -> None:
    client = desk.operators.join()
    desk.say(client, engage=True, twist={"vx": 0.5})
    desk.say(client, height=0.9, hands={"left": [0.5] * 6})
    desk.say(client, neck={"yaw": 0.3})
    assert desk.command.twist.tolist() == [0.5, 0, 0]
    assert (desk.command.engage, desk.command.height) == (True, 0.9)
    assert desk.command.hands.tolist() == [[0.5] * 6, [0.0] * 6]
    assert desk.command.neck[0] == 0.3
    assert desk.record["presses"].tolist() == [1, 1]


def test_a_press_starts_from_what_the_robot_does_now(desk: Desk) -> None:
    client = desk.operators.join()
    desk.say(client, engage=True, height=0.85, twist={"vx": 0.5}, wrists={"left": POSE})
    assert desk.record["given"].tolist() == [1, 0]
    desk.say(client, engage=False)
    desk.say(client, engage=True)
    assert desk.command.height == FOLLOWED.height
    assert not desk.command.twist.any()
    assert desk.record["given"].tolist() == [0, 0]
    assert desk.record["presses"].tolist() == [2, 2]


def test_who_only_watches_writes_nothing_and_the_second_one_waits(desk: Desk) -> None:
    first, second = desk.operators.join(), desk.operators.join()
    desk.say(second)
    assert desk.ring.count == 0
    desk.say(first, engage=True)
    desk.say(second, engage=True, twist={"vx": 1.0})
    assert desk.drivers == [first, first]
    assert not desk.command.twist.any()


def test_leaving_releases_the_robot_at_once(desk: Desk) -> None:
    first, second = desk.operators.join(), desk.operators.join()
    desk.say(first, engage=True, twist={"vx": 0.5})
    desk.operators.leave(first)
    assert desk.record["stamp"].tolist() == [0, 0]
    assert not desk.command.engage
    assert not desk.command.twist.any()
    desk.say(second, engage=True)
    assert desk.drivers == [second, second]
    assert desk.record["presses"].tolist() == [2, 2]


def test_two_seconds_of_silence_free_the_lease(desk: Desk) -> None:
    first, second = desk.operators.join(), desk.operators.join()
    desk.say(first, engage=True)
    desk.now += 1.9
    desk.say(second, engage=True)
    assert desk.drivers == [first, first]
    desk.now += 0.2
    assert desk.drivers == [None, None]
    desk.say(second, engage=True)
    assert desk.drivers == [second, second]
    assert desk.record["driver"].tolist() == [2, 2]


def test_a_take_over_with_a_held_engage_is_no_press(desk: Desk) -> None:
    first, second = desk.operators.join(), desk.operators.join()
    desk.say(first, engage=True)
    desk.say(second, take=True, engage=True)
    assert (desk.record["driver"].tolist(), desk.record["presses"].tolist()) == ([2, 2], [1, 1])
    desk.say(second, engage=False)
    desk.say(second, engage=True)
    assert desk.record["presses"].tolist() == [2, 2]


def test_stop_and_reset_need_no_driver_and_are_no_sign_of_life(desk: Desk) -> None:
    desk.operators.stop()
    desk.operators.reset()
    assert (desk.record["stops"], desk.record["resets"], desk.record["stamp"].tolist()) == (1, 1, [0, 0])


def test_what_is_out_of_bounds_is_refused_told_and_no_sign_of_life(desk: Desk) -> None:
    client = desk.operators.join()
    desk.say(client, engage=True)
    before = desk.ring.count
    desk.now += 0.1
    desk.say(client, height=50.0)
    assert desk.ring.count == before
    assert desk.operators.rejected == 1
    assert client.error


def test_a_wrist_out_of_bounds_keeps_its_last_target_and_the_rest_of_the_message_counts(desk: Desk) -> None:
    client = desk.operators.join()
    desk.say(client, engage=True, wrists={"left": POSE})
    desk.now += 0.1
    desk.say(client, twist={"vx": 0.4}, wrists={"left": POSE | {"position": [9, 0, 0]}})
    assert desk.command.wrists[0, 0] == 0.3
    assert desk.command.twist[0] == 0.4
    assert desk.record["stamp"].tolist() == [50_100_000_000] * 2
    assert (desk.operators.rejected, client.error) == (1, "a wrist is out of bounds")


def test_arms_and_legs_of_two_drivers_make_one_command(desk: Desk) -> None:
    ada, bo = desk.operators.join(), desk.operators.join()
    desk.say(ada, roles=["arms"], engage=True, twist={"vx": 1.0}, wrists={"left": POSE})
    desk.say(bo, roles=["legs"], engage=True, twist={"vx": 0.5}, height=0.9, wrists={"right": POSE}, waist=0.3)
    assert desk.drivers == [ada, bo]
    assert (desk.command.twist[0], desk.command.height) == (0.5, 0.9)
    assert desk.command.wrists[0].tolist() == [0.3, 0.2, 0.1, 1, 0, 0, 0]
    assert (desk.command.waist, desk.record["given"].tolist()) == (FOLLOWED.waist, [1, 0])
    desk.say(bo, engage=False, twist={})
    assert desk.record["engage"].tolist() == [1, 0]


def test_one_client_drives_everything_that_is_free(desk: Desk) -> None:
    ada, bo = desk.operators.join(), desk.operators.join()
    desk.say(bo, roles=["legs"], engage=True)
    desk.say(ada, engage=True)
    assert desk.drivers == [ada, bo]
    desk.say(bo, roles=[])
    assert desk.drivers == [ada, None]


def test_a_role_that_falls_free_under_a_held_engage_is_not_engaged_by_it(desk: Desk) -> None:
    ada, bo = desk.operators.join(), desk.operators.join()
    desk.say(bo, roles=["legs"], engage=True)
    desk.say(ada, engage=True)
    desk.operators.leave(bo)
    desk.say(ada, engage=True)
    assert desk.drivers == [ada, ada]
    assert desk.record["presses"].tolist() == [1, 1], "the legs' press was the other one's"
    desk.say(ada, engage=False)
    desk.say(ada, engage=True)
    assert desk.record["presses"].tolist() == [2, 2]


def test_a_driver_hands_over_what_another_one_asks_for(desk: Desk) -> None:
    ada, bo = desk.operators.join(), desk.operators.join()
    desk.say(ada, engage=True, twist={"vx": 0.5})
    desk.say(bo, roles=["legs"], engage=False, ask=True)
    desk.say(ada, engage=True, roles=["arms"], give=bo.key)
    assert desk.drivers == [ada, bo]
    assert desk.record["driver"].tolist() == [1, 2]
    assert not desk.command.twist.any()
    desk.say(ada, engage=True, twist={"vx": 0.5})
    assert not desk.command.twist.any(), "given is given"
    desk.say(bo, engage=True)
    assert desk.record["presses"].tolist() == [1, 2]


def test_nobody_gives_what_they_do_not_drive(desk: Desk) -> None:
    ada, bo, cy = (desk.operators.join() for _ in range(3))
    desk.say(ada, engage=True)
    desk.say(bo, give=cy.key)
    desk.say(ada, engage=True, give="99")
    assert desk.drivers == [ada, ada]
