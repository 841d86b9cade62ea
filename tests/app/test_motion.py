"""A clip drives the arms: through the lease, as far as the guard lets it, and beside somebody who drives the legs."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from app.arbiter import ROLES, Role
from app.cli import main
from app.errors import OddSpeed
from app.inputs.motion import Motion, there_and_back
from app.inputs.operator import Operators
from app.mode import Mode, Reason
from app.protocol import OperatorMessage
from app.shared import COMMAND, Memory, Ring
from policies.arm_model import ArmModel
from policies.command import Command
from policies.motion.clip import Clip, ClipSet
from robots.catalog import load

ROBOT = load("h1")
SPEC = ROBOT.spec
HOME = SPEC.home[SPEC.group("waist", "arms")]


def clip(name: str = "wave") -> Clip:
    """Both shoulders and the waist swing for two seconds."""
    swing = np.sin(np.linspace(0, 6, 100))[:, None]
    q = HOME + swing * np.array([0.3, *[0.2] * 14])
    return Clip(name, 50.0, q, np.zeros((100, 3)), np.ones(100), "s", "val", "other")


class Stage:
    """A player over a command ring; the test says what the guard does."""

    def __init__(self, speed: float = 1.0) -> None:
        self.ring = Ring(Memory().map(Ring.size(COMMAND, 8)), COMMAND, 8)
        self.operators = Operators(self.ring, Command)
        self.modes, self.reasons = [Mode.STOPPED] * 2, [Reason.STARTED] * 2
        self.motion = Motion(ROBOT, clip(), lambda: {"modes": self.modes, "reasons": self.reasons}, speed)  # pyright: ignore
        self.client, self.seq = self.operators.join(), 0

    def guard(self, mode: Mode, reason: Reason) -> None:
        self.modes, self.reasons = [mode] * 2, [reason] * 2

    def play(self, ticks: int = 1) -> Command:
        for _ in range(ticks):
            self.operators.hear(self.client, self.motion.message(self.seq, self.seq / 50, self.command, self.taken))
            self.seq += 1
        return self.command

    @property
    def taken(self) -> list[Role]:
        return [role for role, driver in self.operators.drivers.items() if driver not in (self.client, None)]

    @property
    def command(self) -> Command:
        record = self.ring.newest()
        return Command() if record is None else Command.from_vector(record["vector"])

    @property
    def presses(self) -> int:
        record = self.ring.newest()
        assert record is not None
        return int(record["presses"][ROLES.index("arms")])


def test_wrists_and_waist_are_the_clips_while_the_arms_follow() -> None:
    stage, model = Stage(), ArmModel(ROBOT)
    first = stage.play(30)
    model.pose(HOME)
    np.testing.assert_allclose(first.wrists, model.wrists(), atol=1e-9)  # nobody follows yet: it waits at home
    assert stage.presses >= 1
    stage.guard(Mode.ENGAGED, Reason.ENGAGED)
    q = there_and_back(clip(), HOME)
    played = []
    for row in [*q[1:], *q[:2]]:
        model.pose(row)
        command = stage.play()
        np.testing.assert_allclose(command.wrists, model.wrists(), atol=1e-6)
        played.append(command.waist)
    np.testing.assert_allclose(played, [*q[1:, 0], *q[:2, 0]], atol=1e-6)
    assert np.abs(q[:, 0] - HOME[0]).max() > 0.25


def test_it_never_jumps() -> None:
    q = there_and_back(clip(), HOME + 1.0)
    around = np.concatenate([q, q[:1]])
    assert np.abs(np.diff(around, axis=0)).max() * 50 < 1.0  # the swing's own speed is 0.9 rad/s
    assert len(there_and_back(clip(), HOME, 0.5)) - len(there_and_back(clip(), HOME)) == pytest.approx(100, abs=2)


def test_stop_stops_it_until_somebody_engages() -> None:
    stage = Stage()
    stage.guard(Mode.ENGAGED, Reason.ENGAGED)
    before = stage.play(70)
    stage.guard(Mode.STOPPED, Reason.STOP_PRESSED)
    presses = stage.presses
    held = stage.play(120)
    assert stage.presses == presses
    assert not held.engage
    np.testing.assert_array_equal(held.wrists, before.wrists)
    stage.guard(Mode.HOLD, Reason.STOP_PRESSED)  # somebody presses Engage for the legs
    stage.play(60)
    assert stage.presses > presses
    stage.guard(Mode.STOPPED, Reason.RESET)
    model = ArmModel(ROBOT)
    model.pose(HOME)
    np.testing.assert_allclose(stage.play().wrists, model.wrists(), atol=1e-9)


def test_who_takes_the_arms_has_them() -> None:
    stage = Stage()
    stage.guard(Mode.ENGAGED, Reason.ENGAGED)
    stage.play(40)
    person = stage.operators.join()
    stage.operators.hear(person, OperatorMessage(seq=1, engage=True))
    assert stage.operators.drivers["legs"] is person
    assert stage.operators.drivers["arms"] is not person
    stage.operators.hear(person, OperatorMessage(seq=2, engage=True, take=True, waist=0.5))
    assert stage.play(10).waist == 0.5


def test_it_never_engages_by_itself_after_somebody_else_had_the_arms() -> None:
    stage = Stage()
    stage.guard(Mode.ENGAGED, Reason.ENGAGED)
    stage.play(40)
    at, presses, person = stage.motion._at, stage.presses, stage.operators.join()
    stage.operators.hear(person, OperatorMessage(seq=1, engage=True, take=True, roles=["arms"]))
    stage.play(60)  # the robot follows the person
    stage.operators.leave(person)
    for mode, reason in ((Mode.ENGAGED, Reason.ENGAGED), (Mode.HOLD, Reason.SILENT)):
        stage.guard(mode, reason)
        assert not stage.play(60).engage
    assert (stage.motion._at, stage.presses) == (at, presses)
    stage.guard(Mode.STOPPED, Reason.RESET)
    assert stage.play(60).engage


def test_a_reset_of_who_has_the_arms_is_theirs() -> None:
    stage = Stage()
    stage.guard(Mode.ENGAGED, Reason.ENGAGED)
    stage.play(40)
    person = stage.operators.join()
    stage.operators.hear(person, OperatorMessage(seq=1, take=True, roles=["arms"]))
    stage.guard(Mode.STOPPED, Reason.RESET)
    stage.play(10)
    stage.operators.leave(person)
    assert not stage.play(60).engage


def test_a_speed_that_makes_no_motion_is_refused() -> None:
    for speed in (0.0, -1.0, 9.0, float("nan")):
        with pytest.raises(OddSpeed, match="--speed"):
            Stage(speed)


def test_the_command_lists_known_clips(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = tmp_path / "clips.npz"
    ClipSet.of(SPEC, [clip("07_01"), clip("waving")]).save(store)
    (tmp_path / "bad.bvh").write_text("HIERARCHY")
    for name, told in (
        ("wavin", "no clip named 'wavin' in .*known clips: waving, 07_01"),
        (str(tmp_path / "bad.bvh"), "bad.bvh: "),
        ("07_01~mirrored", "known clips: 07_01, waving"),
    ):
        assert main(["replay-motion", name, "--clips", str(store), "--port", "0"]) == 1
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert re.search(told, said)
