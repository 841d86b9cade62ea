"""Waist and arms of a robot whose pelvis is nailed to the world: the model that inverse kinematics thinks in.

The pelvis sits at the world's origin, so world and pelvis frame are one. Legs, hands and neck are welded at home; their mass
and their collision shapes stay. MuJoCo's own collision detection gives the distances and their gradients for every explicit
contact pair in one call.
"""

from __future__ import annotations

import mujoco
import numpy as np

from robots.catalog import Robot
from robots.state import GRAVITY

SIGHT = 0.12
"""Surfaces closer than this are seen as obstacles [m]: more than two hands close in one tick at full joint speed."""


class ArmModel:
    """Kinematics, clearances and gravity torques at one placement of the joints. Joints are in motor order, waist first."""

    def __init__(self, robot: Robot) -> None:
        spec = robot.spec
        names = [j.name for j in spec.motors[spec.group("waist", "arms")]]
        self._model = model = _compile(robot, set(names))
        self._data = mujoco.MjData(model)
        self.size = len(names)
        order = np.array([model.joint(name).qposadr[0] for name in names])
        self._order = slice(None) if (order == np.arange(self.size)).all() else order
        sites = [model.site(name).id for name in spec.wrists]
        self.arms = np.array([[name in self._above(site) for name in names] for site in sites])
        """Which joints lie between the pelvis and the left and the right wrist [2, size], bool."""
        self._shoulders = [model.joint(names[int(np.argmax(arm & ~self.arms.all(0)))]).id for arm in self.arms]
        # Views into MuJoCo's and our own arrays, made once: making them costs more than the arithmetic they serve.
        data, self._jacobian, self._errors = self._data, np.empty((12, self.size)), np.empty(12)
        self._wrists = [(site, data.site_xpos[site], data.site_xmat[site], np.empty(4)) for site in sites]
        self._halves = [(self._jacobian[i : i + 3], self._jacobian[i + 3 : i + 6]) for i in (0, 6)]
        self._missing = [(self._errors[i : i + 3], self._errors[i + 3 : i + 6]) for i in (0, 6)]
        self._torque = np.empty(self.size)

    def _above(self, site: int) -> set[str]:
        """Names of the joints that move a site."""
        model, found = self._model, set()
        body = model.site_bodyid[site]
        while body:
            first = model.body_jntadr[body]
            found |= {model.joint(first + i).name for i in range(model.body_jntnum[body])}
            body = model.body_parentid[body]
        return found

    def pose(self, q: np.ndarray) -> None:
        """Move the joints to q [size], rad. Enough for the wrists and for torques; says nothing of obstacles."""
        self._data.qpos[self._order] = q
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        for _, _, turn, quaternion in self._wrists:
            mujoco.mju_mat2Quat(quaternion, turn)

    def place(self, q: np.ndarray) -> None:
        """Move the joints to q [size], rad; everything below speaks of this placement."""
        self.pose(q)
        mujoco.mj_collision(self._model, self._data)
        mujoco.mj_makeConstraint(self._model, self._data)

    def wrists(self) -> np.ndarray:
        """Left and right wrist: position [m] and quaternion wxyz in the pelvis frame [2, 7]."""
        poses = np.empty((2, 7))
        for pose, (_, position, _, quaternion) in zip(poses, self._wrists, strict=True):
            pose[:3], pose[3:] = position, quaternion
        return poses

    def shoulders(self) -> np.ndarray:
        """Where the first joint of the left and of the right arm sits in the pelvis frame [2, 3], m."""
        return self._data.xanchor[self._shoulders]

    def errors(self, wrists: np.ndarray) -> np.ndarray:
        """What is missing to the poses [2, 7]: left translation [m], left rotation vector [rad], then the right ones [12].

        The next call overwrites it.
        """
        for target, (_, position, _, quaternion), (shift, spin) in zip(wrists, self._wrists, self._missing, strict=True):
            np.subtract(target[:3], position, out=shift)
            mujoco.mju_subQuat(spin, target[3:], quaternion)
            mujoco.mju_rotVecQuat(spin, spin.copy(), quaternion)  # from the wrist's frame to the pelvis frame
        return self._errors

    def jacobian(self) -> np.ndarray:
        """How a joint's turn moves and turns the wrists, rows as in `errors` [12, size]; the next call overwrites it."""
        for (site, *_), (shift, spin) in zip(self._wrists, self._halves, strict=True):
            mujoco.mj_jacSite(self._model, self._data, shift, spin, site)
        return self._jacobian[:, self._order]

    def obstacles(self) -> tuple[np.ndarray, np.ndarray]:
        """Distances between the surfaces in sight [k], m (negative: they overlap), and how a joint's turn changes them [k, size]."""
        data, count = self._data, self._data.nefc
        return data.efc_pos[:count], data.efc_J[: count * self.size].reshape(count, self.size)[:, self._order]

    def clearance(self) -> float:
        """The smallest of those distances, at most `SIGHT` [m]."""
        return min(self._data.efc_pos.tolist(), default=SIGHT)

    def torque(self, speed: np.ndarray, acceleration: np.ndarray, gravity: np.ndarray) -> np.ndarray:
        """Torque that gives the joints a speed [size], rad/s, and an acceleration [size], rad/s^2, from here on [size], N m.

        gravity: what pulls at every body, in the pelvis frame [3], g.
        """
        model, data = self._model, self._data
        model.opt.gravity[:] = GRAVITY * gravity
        data.qvel[self._order], data.qacc[self._order] = speed, acceleration
        mujoco.mj_comVel(model, data)
        mujoco.mj_rne(model, data, 1, self._torque)
        self._torque += model.dof_armature * data.qacc + model.dof_damping * data.qvel
        return self._torque[self._order].copy()


def _compile(robot: Robot, names: set[str]) -> mujoco.MjModel:
    """The robot's training model with only the named joints left, placed at the world's origin."""
    spec = robot.build("training")
    spec.compiler.fusestatic = False  # fusing moves geoms and leaves the contact pairs pointing at the old ones (MuJoCo 3.14)
    for rows in (spec.keys, spec.actuators, spec.sensors, spec.equalities):
        for row in list(rows):
            spec.delete(row)
    home = {j.name: j.home for j in robot.spec.joints}
    moved: set[str] = set()
    for joint in list(spec.joints):
        if joint.name in names:
            moved |= {geom.name for geom in joint.parent.find_all("geom")}
        else:
            _weld(joint, home.get(joint.name, 0.0))
            spec.delete(joint)
    for geom in spec.geoms:
        geom.contype = geom.conaffinity = 0  # explicit pairs only
    for pair in list(spec.pairs):
        if pair.geomname1 in moved or pair.geomname2 in moved:
            pair.condim, pair.margin = 1, SIGHT
        else:
            spec.delete(pair)
    option = spec.option
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT | mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
    return spec.compile()


def _weld(joint: mujoco.MjsJoint, angle: float) -> None:
    """Turn the joint's body as the joint would, or bring it to the origin if the joint lets it float."""
    body, turn = joint.parent, np.empty(4)
    if joint.type == mujoco.mjtJoint.mjJNT_FREE:
        body.pos, body.quat = (0, 0, 0), (1, 0, 0, 0)
        return
    mujoco.mju_axisAngle2Quat(turn, np.array(joint.axis), angle)
    turned = np.empty(4)
    mujoco.mju_mulQuat(turned, np.array(body.quat), turn)
    body.quat = turned
