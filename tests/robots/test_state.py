"""What a State says of itself, in cases that can be computed by hand."""

from dataclasses import replace

import numpy as np
import pytest

from robots.state import State

HALF = np.sqrt(0.5)


def state(quaternion=(1, 0, 0, 0), velocity=(0, 0, 0), gyro=(0, 0, 0)) -> State:
    none = np.zeros(0)
    return State(
        time=np.array(0.0),
        position=np.zeros(3),
        quaternion=np.array(quaternion, dtype=float),
        velocity=np.array(velocity, dtype=float),
        gyro=np.array(gyro, dtype=float),
        q=none,
        dq=none,
        feet=np.zeros((2, 3)),
        feet_velocity=np.zeros((2, 3)),
        touch=np.zeros(2),
    )


@pytest.mark.parametrize(
    ("quaternion", "gravity"),
    [
        ((1, 0, 0, 0), (0, 0, -1)),
        ((HALF, 0, 0, HALF), (0, 0, -1)),  # turned left: gravity stays below
        ((HALF, 0, HALF, 0), (1, 0, 0)),  # pitched 90 degrees forward: the chest (+x) looks down
        ((HALF, HALF, 0, 0), (0, -1, 0)),  # rolled 90 degrees to the right: the right side (-y) is down
        ((0, 1, 0, 0), (0, 0, 1)),  # upside down
    ],
)
def test_gravity_in_the_pelvis_frame(quaternion, gravity):
    np.testing.assert_allclose(state(quaternion).gravity, gravity, atol=1e-12)


@pytest.mark.parametrize(("quaternion", "yaw"), [((1, 0, 0, 0), 0), ((HALF, 0, 0, HALF), np.pi / 2), ((HALF, 0, 0, -HALF), -np.pi / 2)])
def test_yaw_is_positive_to_the_left(quaternion, yaw):
    assert state(quaternion).yaw == pytest.approx(yaw)


def test_roll_is_positive_to_the_right_and_pitch_forward():
    np.testing.assert_allclose(state((np.cos(0.1), np.sin(0.1), 0, 0)).roll_pitch, (0.2, 0), atol=1e-12)
    np.testing.assert_allclose(state((np.cos(0.1), 0, np.sin(0.1), 0)).roll_pitch, (0, 0.2), atol=1e-12)


def test_heading_velocity_turns_with_the_robot_and_ignores_its_lean():
    facing_left = (HALF, 0, 0, HALF)  # the robot's front is the world's +y
    np.testing.assert_allclose(state(facing_left, (0, 0.5, 0)).heading_velocity, (0.5, 0), atol=1e-12)
    np.testing.assert_allclose(state(facing_left, (0.5, 0, 0)).heading_velocity, (0, -0.5), atol=1e-12)
    leaning = (np.cos(0.2), 0, np.sin(0.2), 0)
    np.testing.assert_allclose(state(leaning, (0.5, 0.1, 9)).heading_velocity, (0.5, 0.1), atol=1e-12)


def test_yaw_rate_is_about_the_vertical_whatever_the_lean():
    assert state((1, 0, 0, 0), gyro=(0, 0, 0.7)).yaw_rate == pytest.approx(0.7)
    lying_on_the_chest = (HALF, 0, HALF, 0)
    assert state(lying_on_the_chest, gyro=(-0.7, 0, 0)).yaw_rate == pytest.approx(0.7)
    assert state(lying_on_the_chest, gyro=(0, 0, 0.7)).yaw_rate == pytest.approx(0)


def test_a_batch_reads_like_its_rows():
    rng = np.random.default_rng(0)
    quaternions = rng.normal(size=(5, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    velocity, gyro = rng.normal(size=(2, 5, 3))
    batch = replace(state(), quaternion=quaternions, velocity=velocity, gyro=gyro)
    rows = [state(q, v, w) for q, v, w in zip(quaternions, velocity, gyro, strict=True)]
    for name in ("gravity", "yaw", "roll_pitch", "heading_velocity", "yaw_rate"):
        np.testing.assert_allclose(getattr(batch, name), [getattr(row, name) for row in rows], atol=1e-12)


def test_it_has_fallen_when_tilted_too_far_too_low_or_not_a_number():
    leaning = [np.deg2rad(angle) / 2 for angle in (0, 59, 61)]
    robots = replace(state(), quaternion=np.array([[np.cos(a), np.sin(a), 0, 0] for a in leaning]), position=np.full((3, 3), 1.0))
    assert robots.fallen(0.5).tolist() == [False, False, True]
    assert robots.fallen(1.0).all()
    assert replace(robots, position=np.full((3, 3), np.nan)).fallen(0.5).all()


def test_a_sole_touches_the_ground_when_it_carries_something():
    assert replace(state(), touch=np.array([[300.0, 1.0], [np.nan, 6.0]])).contact.tolist() == [[True, False], [False, True]]
