"""What a robot senses in one tick; every array may carry leading batch dimensions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

GRAVITY = 9.81
"""m/s^2"""
CONTACT = 5.0
"""A sole that carries more touches the ground [N]."""
FALLEN_TILT = np.deg2rad(60)
"""A robot whose up axis leans further than this from the vertical has fallen [rad]."""


@dataclass(frozen=True)
class State:
    """One reading of the robot. `nu` is the number of motors of the model that was stepped
    (41 in the H1's play model, 27 in its training model)."""

    time: np.ndarray
    """Simulated seconds [...]."""
    position: np.ndarray
    """Pelvis position in the world [..., 3], m."""
    quaternion: np.ndarray
    """Pelvis orientation in the world, wxyz [..., 4]."""
    velocity: np.ndarray
    """Pelvis linear velocity in the world [..., 3], m/s. Not seen by the leg policy's actor."""
    gyro: np.ndarray
    """Pelvis angular velocity in the pelvis frame [..., 3], rad/s."""
    q: np.ndarray
    """Motor angles [..., nu], rad."""
    dq: np.ndarray
    """Motor speeds [..., nu], rad/s."""
    feet: np.ndarray
    """Sole positions (left, right) in the pelvis frame [..., 2, 3], m: forward kinematics of the encoders."""
    feet_velocity: np.ndarray
    """Sole velocities in the pelvis frame, relative to it [..., 2, 3], m/s."""
    touch: np.ndarray
    """Normal force under each sole [..., 2], N."""

    def in_pelvis(self, vector: np.ndarray) -> np.ndarray:
        """A vector of the world [..., 3] in the pelvis frame."""
        w, axis = self.quaternion[..., :1], -self.quaternion[..., 1:]
        t = 2 * np.cross(axis, vector)
        return vector + w * t + np.cross(axis, t)

    @property
    def gravity(self) -> np.ndarray:
        """Unit gravity in the pelvis frame [..., 3]; (0, 0, -1) when upright."""
        w, x, y, z = np.moveaxis(self.quaternion, -1, 0)
        return np.stack([-2 * (x * z - w * y), -2 * (y * z + w * x), 2 * (x * x + y * y) - 1], axis=-1)

    @property
    def yaw(self) -> np.ndarray:
        """Heading of the pelvis in the world [...], rad."""
        w, x, y, z = np.moveaxis(self.quaternion, -1, 0)
        return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))

    @property
    def roll_pitch(self) -> np.ndarray:
        """Roll and pitch of the pelvis [..., 2], rad (ZYX Euler angles)."""
        g = self.gravity
        return np.stack([np.arctan2(-g[..., 1], -g[..., 2]), np.arcsin(np.clip(g[..., 0], -1, 1))], axis=-1)

    @property
    def heading_velocity(self) -> np.ndarray:
        """Pelvis linear velocity in the heading frame (forward, left) [..., 2], m/s."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        vx, vy = self.velocity[..., 0], self.velocity[..., 1]
        return np.stack([c * vx + s * vy, c * vy - s * vx], axis=-1)

    @property
    def yaw_rate(self) -> np.ndarray:
        """Turning rate about the vertical [...], rad/s."""
        return -(self.gravity * self.gyro).sum(-1)

    @property
    def contact(self) -> np.ndarray:
        """Which soles touch the ground [..., 2]."""
        return self.touch > CONTACT

    def fallen(self, lowest: float) -> np.ndarray:
        """Whether the robot lies [...]: tilted too far, or with its pelvis at or below `lowest` [m]; also if either is not a number."""
        return ~((-self.gravity[..., 2] > np.cos(FALLEN_TILT)) & (self.position[..., 2] > lowest))
