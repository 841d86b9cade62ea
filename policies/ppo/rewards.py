"""What the legs are paid for. Every term is a rate per second; the environment multiplies by the tick.

After ExBody's rewards with explicit gait periodicity (paper, section IV), with kernels narrow enough that standing still
at a walking command does not pay, and velocities judged over half a gait period, so that the sway of a step is no error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from policies.gait import SWING_HEIGHT, Gait
from robots.spec import RobotSpec
from robots.state import State

VELOCITY = 5.75
"""The most that the velocity term pays."""


@dataclass(frozen=True)
class Moment:
    """One tick of every robot as the rewards see it; arrays have the robot first."""

    state: State
    gait: Gait
    twist: np.ndarray
    """Velocity command [n, 3]."""
    posture: np.ndarray
    """Height, roll, pitch command [n, 3]."""
    stance: np.ndarray
    """Leg angles of that posture [n, 12], rad."""
    mean_error: np.ndarray
    """Velocity minus command, both averaged over half a gait period [n, 3]."""
    actions: tuple[np.ndarray, np.ndarray, np.ndarray]
    """This action and the two before it, each [n, 12]."""
    leg_acceleration: np.ndarray
    """Change of leg joint speed over the tick [n, 12], rad/s^2."""
    shoved: np.ndarray
    """Whether the robot was pushed within the last 1.5 s [n]."""


def foot_heights(state: State) -> np.ndarray:
    """Sole height above the floor [n, 2], m."""
    return state.position[:, None, 2] - (state.feet * state.gravity[:, None, :]).sum(-1)


def foot_speeds(state: State) -> np.ndarray:
    """Horizontal speed of each sole over the floor [n, 2], m/s."""
    g = state.gravity
    base = state.in_pelvis(state.velocity)
    v = base[:, None] + state.feet_velocity + np.cross(state.gyro[:, None, :], state.feet)
    return np.linalg.norm(v - (v * g[:, None]).sum(-1, keepdims=True) * g[:, None], axis=-1)


class Rewards:
    """Weighted terms for one robot model."""

    def __init__(self, spec: RobotSpec) -> None:
        legs = spec.group("legs")
        names = [j.name for j in spec.motors[legs]]
        self._lower, self._upper = spec.lower[legs], spec.upper[legs]
        self._legs = legs
        pick = lambda *parts: np.array([i for i, n in enumerate(names) if any(p in n for p in parts)])  # noqa: E731
        self._sideways = pick("hip_yaw", "hip_roll")
        self._pitches = pick("hip_pitch", "knee", "ankle_pitch").reshape(2, 3)
        self._ankle_rolls = pick("ankle_roll")

    def tasks(self, m: Moment) -> dict[str, np.ndarray]:
        """What earns."""
        s, walking = m.state, m.gait.walking
        slow = (m.mean_error[:, :2] ** 2).sum(-1)
        fast = ((s.heading_velocity - m.twist[:, :2]) ** 2).sum(-1)
        turn, turn_now = m.mean_error[:, 2] ** 2, (s.yaw_rate - m.twist[:, 2]) ** 2
        height = foot_heights(s)
        lift = SWING_HEIGHT * np.sin(np.pi * m.gait.swing()) ** 2
        match = np.where(s.contact == m.gait.stance(), 0.5, -0.5).sum(-1)
        sunk, leant = (s.position[:, 2] - m.posture[:, 0]) ** 2, self._lean_error(m)
        return {
            "velocity": 1.5 * np.exp(-slow / 0.12)
            + 1.25 * np.exp(-slow / 0.015)
            + 2.0 * np.exp(-slow / 0.003)
            + 1.0 * np.exp(-fast / 0.06),
            "turning": 0.75 * np.exp(-turn / 0.15)
            + 0.5 * np.exp(-turn / 0.02)
            + 1.0 * np.exp(-turn_now / 0.08)
            + 1.5 * np.exp(-turn_now / 0.015),
            "foot_height": 2.0 * np.exp(-((height - lift) ** 2).sum(-1) / 0.002),
            "contact": match,
            "posture": np.exp(-sunk / 0.01) + 0.5 * np.exp(-sunk / 0.001) + np.exp(-leant / 0.02) + 0.5 * np.exp(-leant / 0.004),
            "leg_pose": 0.6 * np.exp(-2 * self._pose_error(m)) * walking,
            "alive": np.full(len(walking), 0.3),
        }

    @staticmethod
    def _lean_error(m: Moment) -> np.ndarray:
        """Squared distance of gravity in the pelvis frame from where roll and pitch commands put it [n]."""
        _, roll, pitch = m.posture.T
        asked = np.stack([np.sin(pitch), -np.sin(roll) * np.cos(pitch)], -1)
        return ((m.state.gravity[:, :2] - asked) ** 2).sum(-1)

    def _pose_error(self, m: Moment) -> np.ndarray:
        bump = np.sin(np.pi * m.gait.swing())[:, :, None] * np.array([-0.35, 0.6, -0.25])
        q = (m.state.q[:, self._legs] - m.stance)[:, self._pitches]
        return np.linalg.norm((q - bump).reshape(len(q), -1), axis=-1)

    def penalties(self, m: Moment) -> dict[str, np.ndarray]:
        """What costs; scaled up by the curriculum as episodes lengthen."""
        s, gait = m.state, m.gait
        q, dq = s.q[:, self._legs], s.dq[:, self._legs]
        a, b, c = m.actions
        contact = s.contact
        gap = np.hypot(s.feet[:, 0, 0] - s.feet[:, 1, 0], s.feet[:, 0, 1] - s.feet[:, 1, 1])
        over = np.maximum(q - self._upper + 0.05, 0) + np.maximum(self._lower + 0.05 - q, 0)
        quiet = ~gait.walking
        away = q - m.stance
        sole_tilt = s.roll_pitch[:, :1] + q[:, self._sideways[1::2]] + q[:, self._ankle_rolls]
        sole_pitch = s.roll_pitch[:, 1:] + q[:, self._pitches].sum(-1)
        return {
            "height": -4 * np.abs(s.position[:, 2] - m.posture[:, 0]),
            "tilt": -5 * self._lean_error(m),
            "wobble": -0.2 * (s.gyro[:, :2] ** 2).sum(-1),
            "twisting": -2.5 * (s.yaw_rate - m.twist[:, 2]) ** 2,
            "bounce": -1.0 * s.velocity[:, 2] ** 2,
            "action_rate": -0.1 * ((a - b) ** 2).sum(-1) - 0.05 * ((a - 2 * b + c) ** 2).sum(-1),
            "acceleration": -1e-6 * (m.leg_acceleration**2).sum(-1),
            "sideways_joints": -1.0 * (away[:, self._sideways] ** 2).sum(-1),
            "limits": -5 * over.sum(-1),
            "slip": -0.2 * (foot_speeds(s) * contact).sum(-1),
            "sole_tilt": -1.0 * ((sole_tilt**2 + sole_pitch**2) * contact).sum(-1),
            "feet_gap": -5 * np.maximum(0.17 - gap, 0),
            "stand_lift": -0.5 * ((~contact).sum(-1) * quiet),
            "stand_pose": -0.3 * np.abs(away).sum(-1) * quiet * ~m.shoved,
            "stand_motion": -0.03 * np.abs(dq).sum(-1) * quiet * ~m.shoved,
        }
