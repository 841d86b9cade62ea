"""Where the cameras of an export are."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np


@dataclass(frozen=True)
class View:
    """What a camera sees from, in the world."""

    position: np.ndarray
    """[3], m"""
    forward: np.ndarray
    """Unit vector [3]."""
    up: np.ndarray
    """Unit vector [3]."""
    fov: float
    """Vertical field of view [rad]."""


_OF_MODEL = {"head": "head", "head_left": "left_eye", "head_right": "right_eye"}
"""Cameras that the robot has."""
_WRISTS = {"wrist_left": 0, "wrist_right": 1}

NAMES = (*_OF_MODEL, *_WRISTS, "chase")

_WRIST_AT, _WRIST_TILT, _WRIST_FOV = (-0.04, 0.0, 0.11), np.deg2rad(35), np.deg2rad(80)
"""Above the wrist, looking down along the hand: position in the wrist's frame [m], rad, rad."""
_CHASE_BACK, _CHASE_UP, _CHASE_TURN, _CHASE_FOV = 2.6, 0.7, np.deg2rad(25), np.deg2rad(45)
"""Behind the pelvis and above it [m], off to its right so that the arms show, rad."""


def lacking(model: mujoco.MjModel, chosen: tuple[str, ...]) -> list[str]:
    """Those of the chosen cameras that this robot does not have."""
    own = {model.camera(camera).name for camera in range(model.ncam)}
    return [name for name in chosen if name in _OF_MODEL and _OF_MODEL[name] not in own]


def view(name: str, model: mujoco.MjModel, data: mujoco.MjData, wrists: tuple[str, str]) -> View:
    """One of NAMES, once the kinematics of `data` are done; `wrists` are the names of the wrist sites."""
    if name in _OF_MODEL:
        camera = model.camera(_OF_MODEL[name])
        return _of_body(data, int(camera.bodyid[0]), camera.pos, camera.quat, float(np.deg2rad(camera.fovy[0])))
    if name in _WRISTS:
        return _of_wrist(data, wrists[_WRISTS[name]])
    return _chase(data)


def _of_body(data: mujoco.MjData, body: int, position: np.ndarray, quaternion: np.ndarray, fov: float) -> View:
    R_world_body, turn = data.xmat[body].reshape(3, 3), np.empty(9)
    mujoco.mju_quat2Mat(turn, quaternion)
    R_world_camera = R_world_body @ turn.reshape(3, 3)  # MuJoCo's cameras look along their -z
    return View(data.xpos[body] + R_world_body @ position, -R_world_camera[:, 2], R_world_camera[:, 1], fov)


def _of_wrist(data: mujoco.MjData, site: str) -> View:
    R_world_wrist = data.site(site).xmat.reshape(3, 3)
    forward, up = (np.cos(_WRIST_TILT), 0, -np.sin(_WRIST_TILT)), (np.sin(_WRIST_TILT), 0, np.cos(_WRIST_TILT))
    return View(data.site(site).xpos + R_world_wrist @ _WRIST_AT, R_world_wrist @ forward, R_world_wrist @ up, _WRIST_FOV)


def _chase(data: mujoco.MjData) -> View:
    """From behind, level whatever the robot does; bodies are numbered from the world, so 1 is the pelvis."""
    ahead = data.xmat[1].reshape(3, 3)[:, 0]
    yaw = np.arctan2(ahead[1], ahead[0]) + _CHASE_TURN
    away = np.array([-np.cos(yaw) * _CHASE_BACK, -np.sin(yaw) * _CHASE_BACK, _CHASE_UP])
    forward = -away / np.linalg.norm(away)
    right = np.cross(forward, (0, 0, 1))
    return View(data.xpos[1] + away, forward, np.cross(right, forward) / np.linalg.norm(right), _CHASE_FOV)
