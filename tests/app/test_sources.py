"""Sources of this program drive through the same lease and guard as everybody else."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from small_rows import METADATA, PACKED_MODEL, make_rows
from stand_ins import eventually

from app.guard import ask_from
from app.inputs.circle import PERIOD, RADIUS, Circle
from app.inputs.feed import Feed
from app.inputs.operator import Operators
from app.inputs.replay import Replay
from app.mode import Mode
from app.protocol import OperatorMessage, Twist
from app.simulation import Simulation
from policies.command import Command
from policies.episode import EpisodeInfo
from policies.recording.writer import EpisodeWriter


@pytest.fixture(scope="module")
def everybody(shared_simulation: Simulation) -> Operators:
    return Operators(shared_simulation.exchange.commands, shared_simulation.applied)


@pytest.fixture
def operators(everybody: Operators, simulation: Simulation) -> Operators:
    for client in everybody.clients:
        everybody.leave(client)
    everybody.reset()
    eventually(lambda: simulation.snapshot()["mode"] == Mode.STOPPED)
    return everybody


@pytest.fixture
def circling(simulation: Simulation, operators: Operators) -> Iterator[Feed]:
    feed = Feed(Circle(), operators, simulation.applied)
    yield feed
    feed.close()


def test_a_circle_comes_out_of_the_guard_as_a_circle(simulation: Simulation, operators: Operators, circling: Feed) -> None:
    start = simulation.applied().wrists[1, :3]
    eventually(lambda: simulation.snapshot()["modes"].tolist() == [Mode.ENGAGED, Mode.HOLD])
    eventually(lambda: np.linalg.norm(simulation.applied().wrists[1, :3] - start) > 1.9 * RADIUS, PERIOD)
    middle = start + np.array([0, 0, RADIUS])
    assert np.linalg.norm(simulation.applied().wrists[1, :3] - middle) == pytest.approx(RADIUS, abs=0.01)
    np.testing.assert_array_equal(simulation.applied().twist, np.zeros(3))
    assert {role: client and client.name for role, client in operators.drivers.items()} == {"arms": "circle", "legs": None}


def test_whoever_takes_the_arms_from_it_has_them(simulation: Simulation, operators: Operators, circling: Feed) -> None:
    eventually(lambda: simulation.snapshot()["modes"][0] == Mode.ENGAGED)
    person = operators.join()
    operators.hear(person, OperatorMessage(seq=1, take=True))
    eventually(lambda: simulation.snapshot()["modes"][0] == Mode.HOLD)
    held = simulation.applied().wrists
    operators.hear(person, OperatorMessage(seq=2))
    assert operators.drivers["arms"] is person
    np.testing.assert_array_equal(simulation.applied().wrists, held)


def test_a_stop_holds_for_good(simulation: Simulation, operators: Operators, circling: Feed) -> None:
    eventually(lambda: simulation.snapshot()["modes"][0] == Mode.ENGAGED)
    operators.stop()
    eventually(lambda: simulation.snapshot()["mode"] == Mode.STOPPED)
    before = operators._seats["arms"].merged.presses
    eventually(lambda: operators.clients[0].seq > 20)
    assert simulation.snapshot()["mode"] == Mode.STOPPED
    assert operators._seats["arms"].merged.presses == before


@pytest.fixture
def recorded(tmp_path: Path) -> Callable[[np.ndarray], Replay]:
    """A replay of an episode in which the robot followed these commands."""

    def record(applied: np.ndarray) -> Replay:
        rows = make_rows(range(len(applied)))
        rows["applied"] = applied
        file, path = io.BytesIO(), tmp_path / "recorded.mcap"
        writer = EpisodeWriter(file, METADATA, PACKED_MODEL)
        writer.begin(EpisodeInfo("r", 1, path, 0.0))
        writer.rows(rows)
        writer.end(0.0)
        writer.finish()
        path.write_bytes(file.getvalue())
        return Replay(str(path))

    return record


def test_a_replay_asks_for_what_was_followed_row_by_row(
    simulation: Simulation, operators: Operators, recorded: Callable[[np.ndarray], Replay]
) -> None:
    rows = np.tile(Command(engage=True).vector(), (4, 1))
    rows[:, 1] = [0.0, 0.1, 0.2, 0.3]
    rows[:, 7] += [0.0, 0.01, 0.02, 0.03]
    replay, client, asked = recorded(rows), operators.join(), []
    for seq in range(4):
        message = replay.message(seq, seq / 50, simulation.applied(), [])
        assert message
        operators.hear(client, message)
        record = simulation.exchange.commands.newest()
        asked.append(ask_from(record, seq).vector)
    np.testing.assert_allclose(np.array(asked)[1:], rows[1:])
    assert replay.message(4, 4 / 50, simulation.applied(), []) is None


def test_a_replay_leaves_alone_what_nobody_drove(simulation: Simulation, recorded: Callable[[np.ndarray], Replay]) -> None:
    rows = np.tile(Command(engage=True, twist=np.array([0.5, 0, 0])).vector(), (3, 1))
    walks = recorded(rows).message(1, 0.02, simulation.applied(), [])
    assert walks == OperatorMessage(seq=1, roles=["legs"], engage=True, twist=Twist(vx=0.5), height=1.0, roll=0.0, pitch=0.0)
    rows[:, 1:4], rows[:, 35] = 0, [0.0, 0.1, 0.2]
    turns = recorded(rows).message(1, 0.02, simulation.applied(), [])
    assert turns
    assert (turns.roles, turns.waist, turns.twist, turns.height) == (["arms"], 0.1, None, None)


def test_a_replay_of_no_recording_says_so(tmp_path: Path) -> None:
    with pytest.raises(OSError, match=r"nothing\.mcap"):
        Replay(str(tmp_path / "nothing.mcap"))
