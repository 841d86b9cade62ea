"""The gait clock: walks on command, recovers when pushed, stops in double support, does not march."""

from dataclasses import replace

import numpy as np

from policies.gait import STANCE, STARTLE, Gait, odometry
from robots import catalog
from robots.plant import Plant
from robots.state import State
from robots.target import Target


def standing(speed: tuple[float, float] = (0.0, 0.0)) -> State:
    """Both soles flat on the floor while the pelvis moves at `speed` in its own frame."""
    over = np.array([[[-speed[0], -speed[1], 0.0]] * 2])
    one = np.ones((1, 1))
    return State(
        time=np.zeros(1),
        position=np.array([[0, 0, 1.0]]),
        quaternion=np.array([[1.0, 0, 0, 0]]),
        velocity=0 * one.repeat(3, 1),
        gyro=0 * one.repeat(3, 1),
        q=0 * one.repeat(27, 1),
        dq=0 * one.repeat(27, 1),
        feet=np.array([[[0, 0.12, -1.0], [0, -0.12, -1.0]]]),
        feet_velocity=over,
        touch=300 * one.repeat(2, 1),
    )


def test_it_does_not_march_at_zero_command():
    gait = Gait(1, 0.02)
    for _ in range(500):
        gait.step(standing((0.2, 0.1)), np.zeros((1, 3)))
        assert not gait.walking[0]
        assert gait.stance().all()
        assert (gait.clock == 0).all()


def test_a_command_starts_it_and_its_end_stops_it_in_double_support():
    gait = Gait(1, 0.02)
    for _ in range(100):
        gait.step(standing((0.5, 0)), np.array([[0.5, 0, 0]]))
    assert gait.walking[0]
    ticks = 0
    while gait.walking[0] and ticks < 200:
        ticks += 1
        phase = gait.phase[0]
        gait.step(standing(), np.zeros((1, 3)))
    assert ticks < 120, "it stops within 2.4 s"
    assert min(phase % 0.5, 0.5 - phase % 0.5) < 0.03, "as a foot has just come down"


def test_a_push_starts_steps_and_calm_ends_them():
    gait = Gait(1, 0.02)
    for _ in range(10):
        gait.step(standing((0.0, STARTLE + 0.3)), np.zeros((1, 3)))
    assert gait.walking[0]
    assert gait.swing()[0, 1] == 0, "pushed to the left, the left foot goes first"
    for _ in range(150):
        gait.step(standing(), np.zeros((1, 3)))
    assert not gait.walking[0]


def test_the_schedule_has_each_foot_down_for_its_share():
    gait, down = Gait(1, 0.02), []
    for _ in range(400):
        gait.step(standing(), np.array([[0.5, 0, 0]]))
        down.append(gait.stance()[0])
    assert np.allclose(np.mean(down, 0), STANCE, atol=0.03)
    assert np.any(down, axis=1).all(), "one foot is always down"


def test_leg_odometry_is_the_pelvis_velocity_while_a_foot_holds():
    plant = Plant(catalog.load("h1"), "training")
    home = plant.spec.home[:27].copy()
    for tick in range(40):
        q = home.copy()
        q[plant.spec.motor_names.index("left_knee_joint")] += 0.1 * np.sin(tick / 5)
        q[plant.spec.motor_names.index("right_knee_joint")] += 0.1 * np.sin(tick / 5)
        state = plant.step(Target(q))
    one = replace(state, **{k: v[None] for k, v in vars(state).items()})
    expected = one.in_pelvis(one.velocity)
    np.testing.assert_allclose(odometry(one), expected, atol=0.08)  # sensors are one physics step old
    assert np.linalg.norm(state.velocity) > 0.2
