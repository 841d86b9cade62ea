"""Finds another way to hold an arm when the way it is held cannot reach its target.

Walking downhill (`ArmSolver`) ends where a joint limit stops it, although the arm could reach the pose with its elbow
elsewhere. The scout knows thousands of random postures; it starts from those whose wrist is nearest to the target and walks
downhill from there, a bit every tick.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from policies.arm_model import ArmModel
from robots.catalog import Robot

POSTURES = 4000
"""Random postures that the scout remembers."""
STARTS, TRIES = 6, 12
"""Postures to start from for one target, and ticks to spend on each."""
ANGLE = 0.25
"""Metres that a radian counts for, when poses are compared."""
FOUND = (0.003, 0.02)
"""Errors at which a pose is reached [m, rad]."""
CLEAR = 0.01
"""Distance that a posture must keep between the parts of the body [m]."""
LEAP = 0.6
"""The farthest that a joint goes in one try [rad]."""
_WEIGHTS = np.array([1.0, 1.0, 1.0, ANGLE, ANGLE, ANGLE])


class Scout:
    """Looks for postures in a model of its own; the robot does not move."""

    def __init__(self, robot: Robot) -> None:
        spec, group = robot.spec, robot.spec.group("waist", "arms")
        self._model, self._lower, self._upper = ArmModel(robot), spec.lower[group], spec.upper[group]
        self.joints = [np.flatnonzero(arm & ~self._model.arms.all(0)) for arm in self._model.arms]
        """Indices of the left and of the right arm's joints."""
        waist = [i for i, j in enumerate(spec.motors[group]) if j.group == "waist"]
        self._postures = np.random.default_rng(0).uniform(self._lower, self._upper, (POSTURES, self._model.size))
        self._postures[:, waist] = spec.home[group][waist]
        self.lengths = np.zeros(2)
        """The farthest that each wrist gets from its shoulder [2], m."""
        wrists = np.empty((2, POSTURES, 7))
        for i, posture in enumerate(self._postures):
            self._model.pose(posture)
            wrists[:, i] = poses = self._model.wrists()
            self.lengths = np.maximum(self.lengths, np.linalg.norm(poses[:, :3] - self._model.shoulders(), axis=1))
        self._places, self._turns = wrists[..., :3].copy(), wrists[..., 3:].copy()

    def search(self, arm: int, pose: np.ndarray, q: np.ndarray) -> Iterator[np.ndarray | None]:
        """Yields None while it thinks, then a posture [n] like q that has the arm's wrist at the pose [7]; ends if it knows none."""
        joints = self.joints[arm]
        for start in self._nearest(arm, pose):
            posture = q.copy()
            posture[joints] = self._postures[start, joints]
            for _ in range(TRIES):
                yield None
                if self._improve(arm, pose, posture):
                    if self._model.clearance() > CLEAR:
                        yield posture
                    break

    def _nearest(self, arm: int, pose: np.ndarray) -> np.ndarray:
        """Numbers of the known postures whose wrist is nearest to the pose, nearest first."""
        away = self._places[arm] - pose[:3]
        cosine = np.abs(self._turns[arm].dot(pose[3:]))
        far = np.einsum("ij,ij->i", away, away) - 8 * ANGLE**2 * cosine  # an angle's square is 8 (1 - cosine of its half), nearly
        best = np.argpartition(far, STARTS)[:STARTS]
        return best[np.argsort(far[best])]

    def _improve(self, arm: int, pose: np.ndarray, posture: np.ndarray) -> bool:
        """Turn the arm's joints nearer to the pose, in place; True if it is reached."""
        self._model.place(posture)
        error = self._model.errors(np.stack([pose, pose]))[6 * arm : 6 * arm + 6]
        x, y, z, *turn = error.tolist()
        if math.hypot(x, y, z) < FOUND[0] and math.hypot(*turn) < FOUND[1]:
            return True
        joints = self.joints[arm]
        jacobian, error = self._model.jacobian()[6 * arm : 6 * arm + 6, joints] * _WEIGHTS[:, None], error * _WEIGHTS
        hessian, slope = jacobian.T.dot(jacobian), error.dot(jacobian)
        diagonal = hessian.reshape(-1)[:: len(joints) + 1]
        diagonal += 1e-4 + 0.05 * error.dot(error)
        at, lower, upper = posture[joints], self._lower[joints], self._upper[joints]
        step = np.linalg.solve(hessian, slope)
        for _ in range(2):  # joints that would pass their limit stand still, the others make up for them
            past = (at + step < lower) | (at + step > upper)
            if not past.any():
                break
            hessian[past], hessian[:, past], slope[past] = 0.0, 0.0, 0.0
            diagonal[past] = 1.0
            step = np.linalg.solve(hessian, slope)
        posture[joints] = np.clip(at + np.clip(step, -LEAP, LEAP), lower, upper)
        return False
