"""Wrist targets that come 20 times a second become a path for 50 ticks a second."""

import numpy as np
import pytest

from policies.interpolator import Interpolator

START = np.tile([0.3, 0.0, 0.1, 1.0, 0, 0, 0], (2, 1))


def at(x: float, angle: float = 0.0) -> np.ndarray:
    """Both wrists at x [m], turned about z by angle [rad]."""
    out = START.copy()
    out[:, 0], out[:, 3], out[:, 6] = x, np.cos(angle / 2), np.sin(angle / 2)
    return out


def turn(pose: np.ndarray) -> float:
    return float(2 * np.arctan2(pose[6], pose[3]))


def test_twenty_targets_a_second_become_an_even_path() -> None:
    interpolator = Interpolator(at(0.0))
    arrivals = [tick for tick in range(200) if int((tick + 1) * 0.4) > int(tick * 0.4)]  # every 2nd or 3rd tick
    target, xs, angles, goals = at(0.0), [], [], []
    for tick in range(200):
        if tick in arrivals:
            target = at(0.02 * (arrivals.index(tick) + 1), 0.02 * (arrivals.index(tick) + 1))  # 0.4 m/s, 0.4 rad/s
        pose = interpolator.step(target)
        xs.append(pose[0, 0])
        angles.append(turn(pose[1]))
        goals.append(target[0, 0])
    steps = np.diff(xs[20:])
    assert steps.min() > 0.002, "it never stops"
    assert steps.max() < 0.014, "it never jumps by a whole input step"
    assert (np.array(xs) <= np.array(goals) + 1e-12).all(), "it never overshoots"
    assert (np.array(goals) - np.array(xs)).max() < 0.02 + 1e-9, "it is less than one target behind"
    assert angles == pytest.approx(xs, abs=1e-6)


def test_a_target_is_reached_exactly_within_one_period() -> None:
    interpolator = Interpolator(at(0.0))
    poses = [interpolator.step(at(0.1, 0.5)) for _ in range(3)]
    assert 0 < poses[0][0, 0] < 0.1
    assert (poses[2] == at(0.1, 0.5)).all()
    assert (interpolator.step(at(0.1, 0.5)) == poses[2]).all()


def test_targets_that_come_every_tick_pass_without_delay() -> None:
    interpolator = Interpolator(at(0.0))
    for tick in range(30):
        pose = interpolator.step(at(0.01 * tick))
    assert pose[0, 0] == pytest.approx(0.29, abs=1e-6)


def test_the_newest_target_wins() -> None:
    interpolator = Interpolator(at(0.0))
    interpolator.step(at(1.0))
    for _ in range(3):
        pose = interpolator.step(at(0.0))
    assert (pose == at(0.0)).all()


def test_the_two_signs_of_a_quaternion_are_one_rotation() -> None:
    interpolator = Interpolator(at(0.0, 0.3))
    flipped = at(0.0, 0.3)
    flipped[:, 3:] *= -1
    for _ in range(4):
        pose = interpolator.step(flipped)
        assert abs(pose[0, 3:] @ flipped[0, 3:]) == pytest.approx(1.0)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e30])
def test_a_row_that_is_no_pose_changes_nothing(bad: float) -> None:
    interpolator = Interpolator(at(0.0))
    broken = at(0.1)
    broken[0, 2] = bad
    for _ in range(5):
        pose = interpolator.step(broken)
    assert np.isnan(pose[0]).all(), "Reach must see that there is no target"
    assert (pose[1] == at(0.1)[1]).all()
    assert interpolator.step(at(0.0))[0, 0] == 0.0
