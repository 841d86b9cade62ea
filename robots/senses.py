"""Reads a `State` out of MuJoCo's arrays: one place for the single plant and for the batch."""

from __future__ import annotations

import mujoco
import numpy as np

from robots.spec import RobotSpec
from robots.state import State


class Senses:
    """Addresses of a robot's joints and sensors in one compiled model.

    Sensor values are one physics step (5 ms) older than qpos and qvel, as mj_step leaves them, in training and in play alike.
    Only after a reset or a restore are they fresh.
    """

    def __init__(self, model: mujoco.MjModel, spec: RobotSpec) -> None:
        motors = [m.name for m in spec.motors[: model.nu]]
        self.q = np.array([model.joint(name).qposadr[0] for name in motors])
        self.dq = np.array([model.joint(name).dofadr[0] for name in motors])
        self._feet = np.concatenate([_at(model, f"{foot}_in_pelvis") for foot in spec.feet])
        self._feet_velocity = np.concatenate([_at(model, f"{foot}_velocity_in_pelvis") for foot in spec.feet])
        self._touch = np.concatenate([_at(model, f"{foot}_touch") for foot in spec.feet])

    def read(self, time: np.ndarray, qpos: np.ndarray, qvel: np.ndarray, sensordata: np.ndarray) -> State:
        """A copy of what the robot senses; arrays may carry leading batch dimensions."""
        batch = qpos.shape[:-1]
        return State(
            time=np.array(time),
            position=qpos[..., 0:3].copy(),
            quaternion=qpos[..., 3:7].copy(),
            velocity=qvel[..., 0:3].copy(),
            gyro=qvel[..., 3:6].copy(),
            q=qpos[..., self.q],
            dq=qvel[..., self.dq],
            feet=sensordata[..., self._feet].reshape(*batch, 2, 3),
            feet_velocity=sensordata[..., self._feet_velocity].reshape(*batch, 2, 3),
            touch=sensordata[..., self._touch],
        )


def _at(model: mujoco.MjModel, sensor: str) -> np.ndarray:
    found = model.sensor(sensor)
    return np.arange(found.adr[0], found.adr[0] + found.dim[0])
