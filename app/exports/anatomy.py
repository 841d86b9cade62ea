"""What the numbers of a recorded row are called, and where a motor's joint stands in qpos and qvel."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from app.exports.errors import ExportError
from policies.command import COMMAND_LAYOUT
from robots import catalog
from robots.spec import Joint

_AXES, _QUATERNION = ("x", "y", "z"), ("qw", "qx", "qy", "qz")
_FINGERS = ("thumb_yaw", "thumb_pitch", "index", "middle", "ring", "pinky")
_SINGULAR = {"legs": "leg", "arms": "arm", "hands": "hand"}

BASE = (*_AXES, *_QUATERNION, "vx", "vy", "vz", "wx", "wy", "wz")
"""The pelvis: position [m], quaternion and velocity [m/s] in the world, angular velocity in its own frame [rad/s]."""

_NAMES = {
    "twist": ("vx", "vy", "yaw_rate"),
    "wrists": tuple(f"{side}_wrist_{axis}" for side in ("left", "right") for axis in (*_AXES, *_QUATERNION)),
    "hands": tuple(f"{side}_{finger}" for side in ("left", "right") for finger in _FINGERS),
    "neck": ("neck_yaw", "neck_pitch"),
    "waist": ("waist_yaw",),
}

COMMAND = tuple(name for field in COMMAND_LAYOUT for name in _NAMES.get(field, (field,)))
"""Numbers of `policies.command.Command.vector`, in order."""


def _halves(field: str, left: str, right: str) -> dict[str, tuple[int, int]]:
    start, stop = COMMAND_LAYOUT[field]
    middle = (start + stop) // 2
    return {left: (start, middle), right: (middle, stop)}


COMMAND_PARTS = {
    "twist": COMMAND_LAYOUT["twist"],
    "posture": (COMMAND_LAYOUT["height"][0], COMMAND_LAYOUT["pitch"][1]),
    **_halves("wrists", "left_wrist", "right_wrist"),
    **_halves("hands", "left_fingers", "right_fingers"),
    "head": COMMAND_LAYOUT["neck"],
    "waist_yaw": COMMAND_LAYOUT["waist"],
}
"""Named pieces of a command: (start, stop)."""


@dataclass(frozen=True)
class Anatomy:
    """Names and places of one recorded robot's numbers."""

    robot: str
    motors: tuple[str, ...]
    """Joint names in motor order [nu]."""
    parts: Mapping[str, tuple[int, int]]
    """left_leg, waist, right_hand and so on -> (start, stop) in motor order."""
    lower: np.ndarray
    """Joint limits [nu], rad."""
    upper: np.ndarray
    qpos: np.ndarray
    """Index of each motor's joint in qpos [nu]."""
    qvel: np.ndarray
    """Index of each motor's joint in qvel [nu]."""
    wrists: tuple[str, str]
    """Names of the wrist sites."""


def anatomy(robot: str, model: mujoco.MjModel) -> Anatomy:
    """Of a recorded robot.

    Raises:
        UnknownRobot: the catalog has no robot of that name.
        ExportError: the recorded model has other motors than the catalog's robot.
    """
    spec = catalog.load(robot).spec
    joints = model.actuator_trnid[:, 0]
    motors = tuple(model.joint(joint).name for joint in joints)
    if motors != spec.motor_names:
        raise ExportError(f"the recorded {robot} has other motors than the installed one; export it with the version that recorded it")
    return Anatomy(
        robot=robot,
        motors=motors,
        parts=_parts(spec.motors),
        lower=spec.lower,
        upper=spec.upper,
        qpos=model.jnt_qposadr[joints],
        qvel=model.jnt_dofadr[joints],
        wrists=spec.wrists,
    )


def _parts(motors: tuple[Joint, ...]) -> dict[str, tuple[int, int]]:
    parts, start = {}, 0
    for name, run in itertools.groupby(motors, _part):
        stop = start + len(list(run))
        parts[name], start = (start, stop), stop
    return parts


def _part(joint: Joint) -> str:
    side = {"left_": "left_", "L_": "left_", "right": "right_", "R_": "right_"}
    prefix = next((word for start, word in side.items() if joint.name.startswith(start)), "")
    return prefix + _SINGULAR.get(joint.group, joint.group) if prefix else joint.group
