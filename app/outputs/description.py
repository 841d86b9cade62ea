"""What a page must know of the robot to move its picture: names in the scene and the tree of joints."""

from __future__ import annotations

import mujoco
import numpy as np

from app.protocol import Quaternion, Vector3, Wire
from policies.envelope import POSTURE, TWIST
from robots.spec import RobotSpec

BODIES = "/robot/"
"""What the scene calls a body, followed by its name in the model."""
PELVIS = BODIES + "pelvis"
EYES = "head"
"""Camera of the robot's-eye view."""


class SceneJoint(Wire):
    """One joint of a body. All but the free joint turn or slide by qpos[at] - zero."""

    type: str
    """free, hinge or slide; free has its position and quaternion wxyz at qpos[at:at + 7]."""
    at: int
    """Index in qpos."""
    zero: float
    """Value at which the body is where its parent puts it [rad or m]."""
    axis: Vector3
    anchor: Vector3
    """A point on the axis, in the body's frame [m]."""


class SceneBody(Wire):
    """One body, after its parent."""

    name: str
    parent: int
    """Index in the list; -1: the world."""
    position: Vector3
    """In its parent's frame [m]."""
    quaternion: Quaternion
    joints: tuple[SceneJoint, ...]
    node: str | None
    """Its name in the scene; None if nothing of it is drawn."""


class SceneWrist(Wire):
    """Names in the scene."""

    handle: str
    ghost: str
    reason: str
    ahead: tuple[str, ...]
    """Beads, for the way that the motion prior expects."""
    expected: str
    """A hand, for where it is expected in half a second."""


class SceneEye(Wire):
    """The camera of the robot's-eye view: it looks along forward, with up up."""

    body: int
    """Index in the list of bodies."""
    position: Vector3
    """In the body's frame [m]."""
    forward: Vector3
    up: Vector3
    fov: float
    """Vertical field of view [rad]."""


class SceneTrained(Wire):
    """What the legs are trained for, beyond which nothing is followed: lower and upper (policies.envelope)."""

    vx: tuple[float, float]
    vy: tuple[float, float]
    """m/s"""
    yaw_rate: tuple[float, float]
    """rad/s"""
    height: tuple[float, float]
    """m"""
    roll: tuple[float, float]
    pitch: tuple[float, float]
    """rad"""


class SceneDescription(Wire):
    """GET /api/scene."""

    bodies: tuple[SceneBody, ...]
    pelvis: int
    """Index of the body that the wrists' poses refer to."""
    wrists: tuple[SceneWrist, SceneWrist]
    """Left and right."""
    pinches: tuple[tuple[float, ...], tuple[float, ...]] | None
    """What `hands` says of the left and the right hand for thumb and index fingertip to touch; None for a robot without hands."""
    eye: SceneEye
    trained: SceneTrained
    nq: int
    """Numbers in a qpos."""


def describe(spec: RobotSpec, model: mujoco.MjModel, drawn: list[str], wrists: list[SceneWrist]) -> SceneDescription:
    """The description of a robot and its model, of which the bodies `drawn` stand in the scene."""
    left, right = wrists
    return SceneDescription(
        bodies=tuple(_body(model, i, drawn) for i in range(1, model.nbody)),
        pelvis=model.body("pelvis").id - 1,
        wrists=(left, right),
        pinches=spec.hands and (spec.hands[0].pinch, spec.hands[1].pinch),
        eye=_eye(model),
        trained=_trained(),
        nq=model.nq,
    )


def _trained() -> SceneTrained:
    ranges = np.hstack([TWIST, POSTURE]).T.tolist()
    return SceneTrained(**{name: (low, high) for name, (low, high) in zip(SceneTrained.model_fields, ranges, strict=True)})


def _body(model: mujoco.MjModel, index: int, drawn: list[str]) -> SceneBody:
    name = model.body(index).name
    first, count = model.body_jntadr[index], model.body_jntnum[index]
    return SceneBody(
        name=name,
        parent=int(model.body_parentid[index]) - 1,
        position=_three(model.body_pos[index]),
        quaternion=tuple(model.body_quat[index].tolist()),
        joints=tuple(_joint(model, j) for j in range(first, first + count)),
        node=BODIES + name if name in drawn else None,
    )


def _joint(model: mujoco.MjModel, index: int) -> SceneJoint:
    kind = {mujoco.mjtJoint.mjJNT_FREE: "free", mujoco.mjtJoint.mjJNT_HINGE: "hinge", mujoco.mjtJoint.mjJNT_SLIDE: "slide"}
    at = int(model.jnt_qposadr[index])
    return SceneJoint(
        type=kind[mujoco.mjtJoint(model.jnt_type[index])],
        at=at,
        zero=float(model.qpos0[at]),
        axis=_three(model.jnt_axis[index]),
        anchor=_three(model.jnt_pos[index]),
    )


def _eye(model: mujoco.MjModel) -> SceneEye:
    camera = model.camera(EYES)
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, camera.quat)
    right_up_back = turn.reshape(3, 3)
    return SceneEye(
        body=int(camera.bodyid[0]) - 1,
        position=_three(camera.pos),
        forward=_three(-right_up_back[:, 2]),
        up=_three(right_up_back[:, 1]),
        fov=float(np.deg2rad(camera.fovy[0])),
    )


def _three(row: np.ndarray) -> Vector3:
    x, y, z = row.tolist()
    return x, y, z
