"""Kinematics of one robot hand in a frame that a human hand has too, so that both can be compared."""

from __future__ import annotations

import mujoco
import numpy as np

from robots.spec import Hand, RobotSpec

FINGERS = ("thumb", "index", "middle", "ring", "pinky")


def palm_axes(wrist: np.ndarray, knuckles: np.ndarray) -> np.ndarray:
    """Axes of a palm as rows [3, 3]: out of its plane, from pinky to index, from the wrist to the middle knuckle.

    Args:
        wrist: [3], m
        knuckles: of all five fingers, thumb first [5, 3], m

    Raises:
        ValueError: the points lie on a line.
    """
    ahead = knuckles[2] - wrist
    ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-9)
    across = knuckles[1] - knuckles[4]
    across = across - ahead * (ahead @ across)
    width = float(np.linalg.norm(across))
    if not width > 1e-4:  # false for a NaN, too
        raise ValueError("the knuckles of a hand do not lie on a line")
    across /= width
    (x, y, z), (u, v, w) = across.tolist(), ahead.tolist()
    return np.array([[y * w - z * v, z * u - x * w, x * v - y * u], across, ahead])


def drive_range(spec: RobotSpec) -> tuple[np.ndarray, np.ndarray]:
    """Angles of the hands' motors, open and closed, [n] each, rad: what 0 and 1 in `Command.hands` mean."""
    hands = spec.group("hands")
    return np.maximum(spec.lower, 0.0)[hands], spec.upper[hands]


class HandModel:
    """Fingertips of one hand as a function of its drives; points are in the palm's frame (`palm_axes`), origin at the wrist."""

    def __init__(self, spec: RobotSpec, model: mujoco.MjModel, side: int) -> None:
        """side: 0 left, 1 right. model: a play model, only read.

        Raises:
            ValueError: the robot has no hands.
        """
        if spec.hands is None:
            raise ValueError(f"{spec.name} has no hands")
        hand = spec.hands[side]
        self._model, self._data = model, mujoco.MjData(model)
        motors = spec.motors[spec.group("hands")]
        drives = [j.name for j in motors[side * len(motors) // 2 : (side + 1) * len(motors) // 2]]
        followers = [j for j in spec.joints if j.mimic and j.mimic[0] in drives]
        joints = [model.joint(name) for name in (*drives, *(j.name for j in followers))]
        self._qpos = np.array([joint.qposadr[0] for joint in joints])
        self._dofs = np.array([joint.dofadr[0] for joint in joints])
        self._ratios = np.vstack([np.eye(len(drives)), np.zeros((len(followers), len(drives)))])
        """Turn of each joint for a turn of each drive [joints, drives]."""
        for row, joint in enumerate(followers, start=len(drives)):
            assert joint.mimic is not None
            self._ratios[row, drives.index(joint.mimic[0])] = joint.mimic[1]
        self._sites = [model.site(name).id for name in hand.tips]
        self._jacobian, self._xpos = np.zeros((len(self._sites), 3, model.nv)), self._data.site_xpos  # views cost more than the sums
        self._settle(hand)
        self.place(np.zeros(len(drives)))
        self.lengths = np.linalg.norm(self.tips() - self.knuckles, axis=1)
        """Of the stretched fingers, knuckle to tip [5], m."""

    def _settle(self, hand: Hand) -> None:
        """Find the palm's frame."""
        data = self._data
        mujoco.mj_kinematics(self._model, data)
        wrist = data.body(hand.palm).xpos.copy()
        knuckles = np.array([data.body(name).xpos for name in hand.knuckles])
        self._origin, self._axes = wrist, palm_axes(wrist, knuckles)
        self.knuckles = (knuckles - wrist) @ self._axes.T
        """[5, 3], m"""

    def place(self, q: np.ndarray) -> None:
        """Turn the drives to q [drives], rad; the methods below speak of this placement."""
        self._data.qpos[self._qpos] = self._ratios @ q
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)

    def tips(self) -> np.ndarray:
        """[5, 3], m"""
        return (self._xpos[self._sites] - self._origin) @ self._axes.T

    def jacobian(self) -> np.ndarray:
        """How a drive's turn moves the tips [5, 3, drives], m/rad."""
        for row, site in zip(self._jacobian, self._sites, strict=True):
            mujoco.mj_jacSite(self._model, self._data, row, None, site)
        return self._axes @ self._jacobian[:, :, self._dofs] @ self._ratios
