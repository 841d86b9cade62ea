"""The guard, tick by tick, without a robot: what it lets through and when it lets go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.guard import SILENT, Guard, sane
from app.limiter import WRIST_SPEED, WRIST_TURN
from app.mode import Mode, Reason
from policies.command import SIZE, Command
from policies.envelope import POSTURE, TWIST
from robots.state import State

DT = 0.02
ARMS, LEGS, BOTH = slice(0, 1), slice(1, 2), slice(0, 2)
HOME = Command(wrists=np.array([[0.25, 0.28, 0, 1, 0, 0, 0], [0.25, -0.28, 0, 1, 0, 0, 0]], dtype=float))


def standing(tilt: float = 0.0, height: float = 1.0) -> State:
    three, two = np.zeros(3), np.zeros((2, 3))
    quaternion = np.array([np.cos(tilt / 2), np.sin(tilt / 2), 0, 0])
    return State(np.array(0.0), np.array([0, 0, height]), quaternion, three, three, np.zeros(41), np.zeros(41), two, two, np.zeros(2))


def shifted(x: float, y: float, z: float) -> np.ndarray:
    """Both wrists, moved from home [m]."""
    return HOME.wrists + np.array([x, y, z, 0, 0, 0, 0])


class Bench:
    """A guard, an operator and a clock that goes on by one tick at a time."""

    def __init__(self) -> None:
        self.guard, self.ask, self.now = Guard(HOME, 1.0, DT), SILENT, 100.0

    def say(self, command: Command | np.ndarray, roles: slice = BOTH, **counters: int | np.ndarray) -> None:
        """A message of the driver of these roles arrives now; its first number tells Engage."""
        vector = command if isinstance(command, np.ndarray) else command.vector()
        stamps, engage = self.ask.stamps.copy(), self.ask.engage.copy()
        stamps[roles], engage[roles] = self.now, bool(vector[0] > 0.5)
        self.ask = replace(self.ask, serial=self.ask.serial + 1, vector=vector, stamps=stamps, engage=engage, **counters)

    def press(self, command: Command = HOME, roles: slice = BOTH) -> None:
        """Engage is pressed."""
        self.say(replace(command, engage=True), roles, presses=self.pressed(roles))

    def pressed(self, roles: slice = BOTH) -> np.ndarray:
        """The counters after one more press."""
        presses = self.ask.presses.copy()
        presses[roles] += 1
        return presses

    def tick(self, state: State | None = None, ticks: int = 1):
        for _ in range(ticks):
            self.now += DT
            ruled = self.guard.step(self.now, self.ask, state or standing())
        return ruled

    def drive(self, seconds: float, roles: slice = BOTH, **fields) -> Command:
        """Message after message with these fields, one a tick; returns what the robot follows at the end."""
        for _ in range(round(seconds / DT)):
            self.say(replace(Command.from_vector(self.ask.vector), engage=True, **fields), roles)
            ruled = self.tick()
        return ruled.command


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def engaged(bench: Bench) -> Bench:
    bench.press()
    assert bench.tick().mode == Mode.ENGAGED
    bench.ask = replace(bench.ask, given=np.ones(2, dtype=bool))
    return bench


def test_stopped_ignores_commands(bench: Bench) -> None:
    bench.say(replace(HOME, twist=np.ones(3)))
    ruled = bench.tick(ticks=10)
    assert (ruled.mode, ruled.reason) == (Mode.STOPPED, Reason.STARTED)
    assert not ruled.command.twist.any()


def test_an_engage_that_is_merely_held_does_not_engage(bench: Bench) -> None:
    bench.say(replace(HOME, engage=True))
    assert bench.tick(ticks=5).mode == Mode.STOPPED
    bench.press()
    assert bench.tick().mode == Mode.ENGAGED


def test_a_press_before_the_guard_existed_is_not_fresh() -> None:
    old = replace(SILENT, serial=4, presses=np.array([7, 7]), stamps=np.full(2, 100.0), engage=np.ones(2, dtype=bool))
    guard = Guard(HOME, 1.0, DT, old)
    assert guard.step(100.0, old, standing()).mode == Mode.STOPPED


@pytest.mark.row(1)
def test_silence_of_200_ms_holds_and_velocity_is_zero_by_300_ms(engaged: Bench) -> None:
    assert engaged.drive(1.0, twist=np.array([1.0, 0.4, 1.0])) is not None
    silent_since = engaged.now - DT  # the newest message came just before the newest tick
    while engaged.now - silent_since <= 0.2 - DT:
        assert engaged.tick().mode == Mode.ENGAGED
    ruled = engaged.tick(ticks=2)
    assert (ruled.mode, ruled.reason) == (Mode.HOLD, Reason.SILENT)
    assert ruled.command.twist.any(), "it brakes, it does not jerk"
    while engaged.now - silent_since < 0.3 - DT:
        ruled = engaged.tick()
    assert not engaged.tick().command.twist.any()


@pytest.mark.row(1)
def test_a_machine_that_misses_ticks_brakes_in_the_same_time(engaged: Bench) -> None:
    engaged.drive(1.0, twist=np.array([1.0, 0.4, 1.0]))
    silent_since = engaged.ask.stamp
    while engaged.now < silent_since + 0.3 - 3 * DT:
        engaged.now += 2 * DT
        ruled = engaged.tick()
    assert not ruled.command.twist.any()


def test_coming_back_from_silence_needs_a_fresh_press(engaged: Bench) -> None:
    engaged.tick(ticks=15)
    engaged.say(replace(HOME, engage=True))
    assert engaged.tick(ticks=3).mode == Mode.HOLD
    engaged.press()
    assert engaged.tick().mode == Mode.ENGAGED


@pytest.mark.row(3)
def test_release_holds_at_once_and_wrists_stay(engaged: Bench) -> None:
    wrists = shifted(0.05, 0, 0.05)
    moved = engaged.drive(0.5, wrists=wrists, height=0.9)
    engaged.say(replace(HOME, engage=False))
    held = engaged.tick(ticks=20)
    assert (held.mode, held.reason) == (Mode.HOLD, Reason.RELEASED)
    np.testing.assert_array_equal(held.command.wrists, moved.wrists)
    assert held.command.height == moved.height


@pytest.mark.row(11)
def test_another_driver_passes_through_hold(engaged: Bench) -> None:
    engaged.say(replace(HOME, engage=True), driver=np.array([2, 2]), presses=engaged.pressed())
    assert engaged.tick().reason == Reason.TAKEN_OVER
    assert engaged.tick(ticks=3).mode == Mode.HOLD
    engaged.press()
    assert engaged.tick().mode == Mode.ENGAGED


@pytest.mark.row(11)
def test_stop_beats_a_press_in_the_same_tick(engaged: Bench) -> None:
    engaged.say(replace(HOME, engage=True), stops=1, presses=engaged.pressed())
    assert engaged.tick().mode == Mode.STOPPED
    assert engaged.tick(ticks=5).reason == Reason.STOP_PRESSED


@pytest.mark.row(8)
@pytest.mark.parametrize("state", [standing(tilt=np.deg2rad(61)), standing(height=0.49)])
def test_a_fall_is_a_fault_in_the_same_tick_and_latches(engaged: Bench, state: State) -> None:
    assert engaged.tick(state).reason == Reason.FALLEN
    engaged.press()
    engaged.ask = replace(engaged.ask, stops=3)
    assert engaged.tick(ticks=10).mode == Mode.FAULT
    engaged.guard.reset()
    assert engaged.tick().mode == Mode.STOPPED


def test_the_first_fault_is_the_one_that_is_told(bench: Bench) -> None:
    bench.guard.fault(Reason.POLICY_FAILED)
    assert bench.tick(standing(height=0.1)).reason == Reason.POLICY_FAILED


def test_commands_are_clipped_to_what_the_legs_were_trained_on(engaged: Bench) -> None:
    command = engaged.drive(2.0, twist=np.array([5.0, -5.0, 5.0]), height=0.3, roll=1.0, pitch=-1.0)
    np.testing.assert_allclose(command.twist, [TWIST[1, 0], TWIST[0, 1], TWIST[1, 2]])
    np.testing.assert_allclose([command.height, command.roll, command.pitch], [POSTURE[0, 0], POSTURE[1, 1], POSTURE[0, 2]])


@pytest.mark.row(5)
def test_engaging_far_from_the_target_moves_the_wrist_slowly_there(engaged: Bench) -> None:
    far = shifted(0.4, 0.2, 0.3)
    first = engaged.drive(DT, wrists=far).wrists
    assert np.linalg.norm(first[:, :3] - HOME.wrists[:, :3], axis=1) == pytest.approx([WRIST_SPEED * DT] * 2)
    np.testing.assert_allclose(engaged.drive(1.0, wrists=far).wrists, far, atol=1e-9)


def test_a_wrist_that_nobody_set_stays(bench: Bench) -> None:
    bench.press()
    np.testing.assert_array_equal(bench.drive(0.5, wrists=shifted(0.1, 0, 0)).wrists, HOME.wrists)


@pytest.mark.row(5)
def test_a_jump_lets_go_until_the_target_comes_back(engaged: Bench) -> None:
    engaged.drive(0.1, wrists=HOME.wrists)
    jumped = HOME.wrists.copy()
    jumped[0, 0] += 0.3
    held = engaged.drive(0.5, wrists=jumped).wrists
    np.testing.assert_array_equal(held, HOME.wrists)
    assert engaged.guard.limiter.let_go.tolist() == [True, False]
    near = shifted(0.1, 0, 0)
    np.testing.assert_allclose(engaged.drive(0.5, wrists=near).wrists, near, atol=1e-9)
    assert not engaged.guard.limiter.let_go.any()


@pytest.mark.row(5)
def test_a_turn_of_more_than_60_degrees_lets_go_and_a_fresh_press_takes_hold_again(engaged: Bench) -> None:
    engaged.drive(0.1, wrists=HOME.wrists)
    turned = HOME.wrists.copy()
    turned[1, 3:] = [np.cos(0.6), 0, 0, np.sin(0.6)]
    np.testing.assert_array_equal(engaged.drive(0.3, wrists=turned).wrists, HOME.wrists)
    engaged.say(replace(HOME, wrists=turned))
    engaged.tick()
    engaged.press(replace(HOME, wrists=turned))
    np.testing.assert_allclose(np.abs(engaged.drive(0.6, wrists=turned).wrists[1, 3:]), np.abs(turned[1, 3:]), atol=1e-9)


def test_the_legs_stop_when_their_driver_is_lost_and_the_arms_go_on(engaged: Bench) -> None:
    engaged.drive(0.5, twist=np.array([0.5, 0, 0]))
    wanted = shifted(0.1, 0, 0.1)
    command = engaged.drive(0.5, ARMS, wrists=wanted)
    assert engaged.guard.modes == [Mode.ENGAGED, Mode.HOLD]
    assert (engaged.guard.mode, engaged.guard.reason) == (Mode.HOLD, Reason.SILENT), "the most severe is told"
    assert not command.twist.any()
    np.testing.assert_allclose(command.wrists, wanted, atol=1e-9)


def test_the_arms_hold_when_their_driver_lets_go_and_the_legs_walk_on(engaged: Bench) -> None:
    before = engaged.drive(0.5, twist=np.array([0.5, 0, 0]), wrists=shifted(0.05, 0, 0)).wrists
    engaged.say(replace(HOME, engage=False, twist=np.array([0.5, 0, 0]), wrists=shifted(0.2, 0, 0)), ARMS)
    command = engaged.drive(0.5, LEGS)
    assert engaged.guard.modes == [Mode.HOLD, Mode.ENGAGED]
    np.testing.assert_array_equal(command.wrists, before)
    np.testing.assert_allclose(command.twist, [0.5, 0, 0])


@pytest.mark.row(11)
def test_taking_the_legs_holds_the_legs_only(engaged: Bench) -> None:
    engaged.drive(0.5, twist=np.array([0.5, 0, 0]))
    engaged.say(replace(HOME, engage=True), driver=np.array([0, 1]))
    engaged.tick()
    assert engaged.guard.modes == [Mode.ENGAGED, Mode.HOLD]
    assert engaged.guard.reason == Reason.TAKEN_OVER
    engaged.press(roles=LEGS)
    assert engaged.tick().mode == Mode.ENGAGED


def test_a_role_that_nobody_drives_does_not_count(bench: Bench) -> None:
    bench.press(roles=LEGS)
    assert bench.tick().mode == Mode.ENGAGED
    assert bench.guard.modes == [Mode.HOLD, Mode.ENGAGED]
    bench.ask = replace(bench.ask, stops=1)
    assert bench.tick().mode == Mode.STOPPED
    assert bench.guard.modes == [Mode.STOPPED] * 2


BAD = {
    "nan": (2, np.nan),
    "infinite": (8, np.inf),
    "far away": (7, 40.0),
    "absurd speed": (1, 1e30),
    "no unit quaternion": (10, 0.2),
}


@pytest.mark.row(4)
@pytest.mark.parametrize(("index", "value"), BAD.values(), ids=BAD.keys())
def test_a_bad_command_is_counted_and_is_no_sign_of_life(engaged: Bench, index: int, value: float) -> None:
    good = engaged.drive(0.3, twist=np.array([0.5, 0, 0]))
    vector = engaged.ask.vector.copy()
    vector[index] = value
    for _ in range(5):
        engaged.say(vector)
        ruled = engaged.tick()
    assert ruled.mode == Mode.ENGAGED
    np.testing.assert_allclose(ruled.command.twist, good.twist, err_msg="the last good command goes on")
    for _ in range(7):
        engaged.say(vector)
        ruled = engaged.tick()
    assert ruled.reason == Reason.SILENT
    assert engaged.guard.rejected == 12


numbers = st.one_of(st.floats(), st.floats(-1.5, 1.5), st.sampled_from([0.0, 1.0, np.nan, np.inf, -np.inf, 1e300]))
vectors = st.lists(numbers, min_size=SIZE, max_size=SIZE).map(np.array)
targets = st.tuples(st.floats(-1.4, 1.4), st.floats(-1.4, 1.4), st.floats(-1.4, 1.4), st.floats(-np.pi, np.pi))


def _honest(target: tuple[float, float, float, float], twist: float) -> np.ndarray:
    x, y, z, angle = target
    pose = [x, y, z, np.cos(angle / 2), 0, np.sin(angle / 2), 0]
    return replace(HOME, engage=True, twist=np.full(3, twist), wrists=np.array([pose, pose])).vector()


honest = st.builds(_honest, targets, st.floats(-3, 3))
moments = st.tuples(st.one_of(vectors, honest, honest), st.integers(1, 8), st.booleans(), st.sampled_from([0.0, 0.0, 0.0, 0.3, 1.2]))


@pytest.mark.row(4, 5)
@settings(max_examples=30, deadline=None)
@given(st.lists(moments, max_size=12))
def test_whatever_arrives_the_robot_follows_finite_commands_within_speed_limits_and_faults_latch(script) -> None:
    bench = Bench()
    bench.press()
    before, faulted = bench.tick().command, False
    bench.ask = replace(bench.ask, given=np.ones(2, dtype=bool))
    for vector, ticks, press, tilt in script:
        bench.say(vector, presses=bench.pressed() if press else bench.ask.presses)
        for _ in range(ticks):
            ruled = bench.tick(standing(tilt))
            _check_step(before, ruled.command)
            faulted |= ruled.mode == Mode.FAULT
            assert (ruled.mode == Mode.FAULT) == faulted
            before = ruled.command


def _check_step(before: Command, after: Command) -> None:
    assert np.isfinite(after.vector()).all()
    assert sane(after.vector())
    assert np.all((after.twist >= TWIST[0]) & (after.twist <= TWIST[1]))
    for was, now in zip(before.wrists, after.wrists, strict=True):
        assert np.linalg.norm(now[:3] - was[:3]) <= WRIST_SPEED * DT + 1e-9
        turned = 2 * np.arccos(np.clip(abs(was[3:] @ now[3:]), 0, 1))
        assert turned <= WRIST_TURN * DT + 1e-6


def test_a_filtered_wrist_is_late_and_says_so_and_a_jump_still_lets_go(engaged: Bench) -> None:
    engaged.ask = replace(engaged.ask, smooth=True)
    wanted = shifted(0.05, 0, 0)
    first = engaged.drive(0.1, wrists=wanted).wrists[0, 0] - HOME.wrists[0, 0]
    assert 0 < first < 0.05
    assert engaged.guard.limiter.delay > 0.01
    np.testing.assert_allclose(engaged.drive(2.0, wrists=wanted).wrists, wanted, atol=1e-3)
    engaged.drive(0.1, wrists=shifted(0.4, 0, 0))
    assert engaged.guard.limiter.let_go.all()
    engaged.ask = replace(engaged.ask, smooth=False)
    engaged.drive(0.1, wrists=wanted)
    assert engaged.guard.limiter.delay == 0
