"""What the legs are trained for, and how fast a command to them may change: training, benches, guard and page keep to the same."""

from __future__ import annotations

import numpy as np

TWIST = np.array([[-0.6, -0.4, -1.0], [1.0, 0.4, 1.0]])
"""Trained velocities: lower, upper [2, 3], m/s and rad/s."""
POSTURE = np.array([[0.82, -0.2, -0.2], [1.02, 0.2, 0.2]])
"""Trained height, roll and pitch: lower, upper [2, 3], m and rad."""
HEIGHT = POSTURE[:, 0]
"""Lower, upper [2], m."""

TWIST_RATE = np.array([2.0, 2.0, 4.0])
"""Accelerations that the legs are asked for [3], m/s^2 and rad/s^2."""
TWIST_BRAKE = 2 * TWIST_RATE
"""Decelerations: a released pedal stops the robot well within 300 ms."""
POSTURE_RATE = np.array([0.3, 0.6, 0.6])
"""Speed of height, roll and pitch [3], m/s and rad/s."""


def next_twist(now: np.ndarray, asked: np.ndarray, dt: float) -> np.ndarray:
    """The velocity command [..., 3] that follows `now` after dt [s] when `asked` is wanted."""
    asked = np.clip(asked, *TWIST)
    rate = np.where(np.abs(asked) < np.abs(now), TWIST_BRAKE, TWIST_RATE)
    return towards(now, asked, rate * dt)


def next_posture(now: np.ndarray, asked: np.ndarray, dt: float) -> np.ndarray:
    """The height, roll and pitch [..., 3] that follow `now` after dt [s] when `asked` is wanted."""
    return towards(now, np.clip(asked, *POSTURE), POSTURE_RATE * dt)


def towards(now: np.ndarray, goal: np.ndarray, step: np.ndarray | float) -> np.ndarray:
    """`goal`, or as near as a step from `now` reaches."""
    return now + np.clip(goal - now, -step, step)
