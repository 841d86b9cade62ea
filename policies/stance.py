"""Where the legs belong when the pelvis is asked to crouch or lean: leg angles for a posture, feet where they are at home.

The leg policy acts around these angles and sees its joints relative to them, so a crouch looks to it like standing upright.
"""

from __future__ import annotations

import itertools

import mujoco
import numpy as np
from scipy.interpolate import RegularGridInterpolator

from policies.observation import joint_mirror
from robots.catalog import Robot

HEIGHTS = np.array([0.76, 0.82, 0.88, 0.94, 1.0, 1.03])
"""m"""
LEANS = np.array([-0.25, -0.125, 0.0, 0.125, 0.25])
"""rad"""


class Stance:
    """Posture commands -> leg angles, interpolated between solved poses."""

    def __init__(self, robot: Robot) -> None:
        spec = robot.spec
        self._legs = spec.group("legs")
        self._lower, self._upper = spec.lower[self._legs], spec.upper[self._legs]
        solved = _solve(robot)
        mirrored = joint_mirror(spec, self._legs)(solved[:, ::-1])  # a lean to the other side, seen in the mirror
        table = (solved + mirrored) / 2
        upright = table[list(HEIGHTS).index(spec.nominal_height), len(LEANS) // 2, len(LEANS) // 2]
        self._interpolate = RegularGridInterpolator((HEIGHTS, LEANS, LEANS), table - upright + spec.home[self._legs])
        self._posture = self._angles = np.empty((0, 3))

    def __call__(self, posture: np.ndarray) -> np.ndarray:
        """Leg angles [n, 12], rad, for height [m], roll and pitch [rad] [n, 3]; postures beyond the table are clamped."""
        if not np.array_equal(posture, self._posture):  # seldom: interpolating takes longer than the leg policy
            low, high = (HEIGHTS[0], LEANS[0], LEANS[0]), (HEIGHTS[-1], LEANS[-1], LEANS[-1])
            self._posture = posture.copy()
            self._angles = np.clip(self._interpolate(np.clip(posture, low, high)), self._lower, self._upper)
        return self._angles.copy()


def _solve(robot: Robot) -> np.ndarray:
    """Leg angles at every point of the table [heights, rolls, pitches, 12], soles flat and the centre of mass above them."""
    model, spec = robot.model("training"), robot.spec
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    mujoco.mj_forward(model, data)
    soles = [(data.site(foot).xpos.copy(), data.site(foot).xmat.copy()) for foot in spec.feet]
    centre = data.subtree_com[1].copy()
    table = np.empty((len(HEIGHTS), len(LEANS), len(LEANS), 12))
    for i, (height, roll, pitch) in enumerate(itertools.product(HEIGHTS, LEANS, LEANS)):
        data.qpos[2] = height
        turn, lean = np.array([np.cos(roll / 2), np.sin(roll / 2), 0, 0]), np.array([np.cos(pitch / 2), 0, np.sin(pitch / 2), 0])
        mujoco.mju_mulQuat(data.qpos[3:7], lean, turn)
        for _ in range(25):
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            data.qpos[:2] -= 0.5 * (data.subtree_com[1, :2] - centre[:2])
            steps = [
                _step_leg(model, data, spec.feet[side], slice(6 * side, 6 * side + 6), place, facing)
                for side, (place, facing) in enumerate(soles)
            ]
            if max(steps) < 1e-4:
                break
        table.reshape(-1, 12)[i] = data.qpos[7:19]
    return table


def _step_leg(model: mujoco.MjModel, data: mujoco.MjData, foot: str, joints: slice, place: np.ndarray, facing: np.ndarray) -> float:
    """One damped Newton step of a leg's six joints towards a sole pose; returns its largest turn [rad]."""
    site = data.site(foot)
    now, wanted, difference = np.empty(4), np.empty(4), np.empty(3)
    mujoco.mju_mat2Quat(now, site.xmat)
    mujoco.mju_mat2Quat(wanted, facing)
    mujoco.mju_subQuat(difference, wanted, now)
    error = np.concatenate([place - site.xpos, site.xmat.reshape(3, 3) @ difference])
    slope = np.empty((6, model.nv))
    mujoco.mj_jacSite(model, data, slope[:3], slope[3:], site.id)
    jacobian = slope[:, 6:][:, joints]
    step = np.linalg.solve(jacobian.T @ jacobian + 1e-4 * np.eye(6), jacobian.T @ error)
    data.qpos[7:19][joints] += np.clip(step, -0.3, 0.3)
    return float(np.abs(step).max())
