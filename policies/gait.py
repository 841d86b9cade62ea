"""When to step: a gait clock that runs while the robot walks or recovers, and stands still otherwise.

A clock that runs at zero command marches in place; a robot without a clock that is pushed has to invent steps. Ours
starts when a velocity is asked for or when the pelvis moves faster than standing allows, and stops in double support
once the robot is calm. It sees only what the robot's own encoders and gyro tell (leg odometry). Every array has the
robot as its first dimension; the same code runs in training and at run time.
"""

from __future__ import annotations

import numpy as np

from robots.state import State

PERIOD = 0.8
"""One left and one right step [s]."""
STANCE = 0.55
"""Share of the period a foot stays on the ground."""
SWING_HEIGHT = 0.09
"""Highest point of a swinging sole [m]."""
STARTLE = 0.35
"""Pelvis speed that starts the clock of a standing robot [m/s]."""
CALM = 0.12
"""Mean pelvis speed below which a robot that need not walk stops stepping [m/s]."""


def odometry(state: State) -> np.ndarray:
    """Pelvis velocity from encoders and gyro, the lower foot taken as fixed [n, 3], m/s, pelvis frame."""
    relative = state.feet_velocity + np.cross(state.gyro[:, None, :], state.feet)
    depth = (state.feet * state.gravity[:, None, :]).sum(-1)
    left = 1 / (1 + np.exp(-np.clip((depth[:, 0] - depth[:, 1]) / 0.005, -30, 30)))
    return -(left[:, None] * relative[:, 0] + (1 - left[:, None]) * relative[:, 1])


class Gait:
    """Phase, and whether the clock runs, for `count` robots.

    The left foot stands while phase < STANCE; the right foot is half a period behind.
    """

    def __init__(self, count: int, dt: float) -> None:
        self.dt = dt
        self.phase = np.zeros(count)
        self.walking = np.zeros(count, bool)
        self.velocity = np.zeros((count, 3))
        """Leg odometry, smoothed over 60 ms [n, 3], m/s, pelvis frame."""
        self._mean = np.zeros((count, 2))
        self._steps = np.zeros(count)

    def reset(self, mask: np.ndarray) -> None:
        """Stand still."""
        for array in (self.phase, self.walking, self.velocity, self._mean, self._steps):
            array[mask] = 0

    def step(self, state: State, twist: np.ndarray) -> None:
        """Advance by one tick; twist is the command [n, 3]."""
        now = odometry(state)
        self.velocity += (self.dt / (self.dt + 0.06)) * (now - self.velocity)
        self._mean += (self.dt / (self.dt + PERIOD / 2)) * (now[:, :2] - self._mean)

        wanted = np.abs(twist).max(-1) > 0.05
        startled = np.linalg.norm(self.velocity[:, :2], axis=-1) > STARTLE
        start = ~self.walking & (wanted | startled)
        lateral = np.where(wanted, twist[:, 1] + 0.3 * twist[:, 2], self.velocity[:, 1])
        self.phase[start] = np.where(lateral > 0, 0.5, 0.0)[start]  # the foot on the side of the motion swings first
        self._steps[start] = 0
        self.walking |= start

        before = self.phase.copy()
        self.phase = (self.phase + self.walking * self.dt / PERIOD) % 1.0
        stepped = (np.floor(2 * before) != np.floor(2 * self.phase)) & self.walking
        self._steps += stepped
        calm = ~wanted & (np.linalg.norm(self._mean, axis=-1) < CALM) & (self._steps >= 2)
        self.walking &= ~(stepped & calm)

    @property
    def clock(self) -> np.ndarray:
        """sin and cos of the phase and 1 while walking; all 0 while standing [n, 3]."""
        angle = 2 * np.pi * self.phase
        return np.stack([np.sin(angle), np.cos(angle), np.ones_like(angle)], -1) * self.walking[:, None]

    def feet_phase(self) -> np.ndarray:
        """Phase of the left and right foot [n, 2]."""
        return np.stack([self.phase, (self.phase + 0.5) % 1.0], -1)

    def stance(self) -> np.ndarray:
        """Whether the schedule has each foot on the ground [n, 2]."""
        return (self.feet_phase() < STANCE) | ~self.walking[:, None]

    def swing(self) -> np.ndarray:
        """Progress of each foot's swing, 0 to 1; 0 on the ground [n, 2]."""
        return np.where(self.stance(), 0.0, (self.feet_phase() - STANCE) / (1 - STANCE))
