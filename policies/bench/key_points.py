"""Shoulders, elbows and wrists of many poses: ExBody's six key points of the upper body."""

from __future__ import annotations

import mujoco
import numpy as np

from robots.catalog import Robot

BODIES = ("left_shoulder_pitch_link", "left_elbow_pitch_link", "right_shoulder_pitch_link", "right_elbow_pitch_link")


class KeyPoints:
    """Forward kinematics of waist and arms from the pelvis."""

    def __init__(self, robot: Robot) -> None:
        self._model = robot.model("training")
        self._data = mujoco.MjData(self._model)
        self._data.qpos[:] = self._model.key("home").qpos
        self._data.qpos[:7] = (0, 0, 0, 1, 0, 0, 0)
        names = robot.spec.motor_names[robot.spec.group("waist", "arms")]
        self._joints = [self._model.joint(name).qposadr[0] for name in names]
        self._bodies = [self._model.body(name).id for name in BODIES]
        self._sites = [self._model.site(name).id for name in robot.spec.wrists]

    def __call__(self, q: np.ndarray) -> np.ndarray:
        """Waist and arm angles [n, 15], rad -> points in the pelvis frame [n, 6, 3], m."""
        points = np.empty((len(q), 6, 3))
        for row, angles in zip(points, q, strict=True):
            self._data.qpos[self._joints] = angles
            mujoco.mj_kinematics(self._model, self._data)
            row[:4], row[4:] = self._data.xpos[self._bodies], self._data.site_xpos[self._sites]
        return points
