"""What a spring-like motor must be told beyond the angle: the torque that its joint needs on the way.

The arms' motors are soft (140 N m/rad at a shoulder): under their own weight the wrists hang 21 mm low, and after a quick
move they swing for two seconds. Both are known in advance from the equations of motion, and so is how steps shake the arms from below,
once the pelvis's acceleration is felt. The rest is corrected by what is measured, with the torques that the joints' common inertia asks
for (computed torque control: Craig, Introduction to Robotics, chapter 10).
"""

from __future__ import annotations

import numpy as np

from policies.arm_model import ArmModel
from robots.catalog import Robot

DOWN = np.array([0.0, 0.0, -1.0])
"""Gravity in the frame of an upright pelvis."""

STIFF, CALM = 80.0, 8.0
"""Accelerations against a deviation [1/s^2] and against its speed [1/s], beside the motor's own. With CALM at 12, fast motions of a
walking robot shake themselves up: what is measured is a tick old, and the pelvis gives way."""
WAIST = 0.3
"""Share of them at the waist, whose motor turns the pelvis as much as the trunk: at 1, some motions twist a standing robot to and fro."""


class Feedforward:
    """Turns joint angles that waist and arms shall have into joint targets that make them have those angles.

    The pelvis counts as unmoved. Gravity may come from any side, and with less or more than 1 g: that is how a pelvis feels to the arms
    which is accelerated along a line. Its turning is left out: the waist's answer would turn the pelvis in its turn.
    """

    def __init__(self, robot: Robot, dt: float = 0.02) -> None:
        spec, group = robot.spec, robot.spec.group("waist", "arms")
        self._model, self._dt = ArmModel(robot), dt
        motors = spec.motors[group]
        self._trust = np.array([WAIST if j.group == "waist" else 1.0 for j in motors])
        self._kp, self._kd, self._effort = (np.array([getattr(j, key) for j in motors]) for key in ("kp", "kd", "effort"))
        self.reset(spec.home[group])

    def reset(self, q: np.ndarray) -> None:
        """The joints rest at q [n], rad."""
        self._q, self._speed = np.array(q, dtype=float), np.zeros(len(q))

    def step(self, q: np.ndarray, gravity: np.ndarray = DOWN, measured: tuple[np.ndarray, np.ndarray] | None = None) -> np.ndarray:
        """What to add to the joint targets q [n] of this tick, rad.

        gravity: what pulls at the arms, in the pelvis frame [3], g. measured: angles [n], rad, and speeds [n], rad/s, of the joints now;
        without them nothing is corrected.
        """
        speed = (q - self._q) / self._dt
        acceleration = (speed - self._speed) / self._dt
        if measured is not None:
            now = (self._q + q) / 2  # a target holds for a whole tick, so a joint that keeps up is half a tick behind its next one
            acceleration += self._trust * (STIFF * (now - measured[0]) + CALM * (speed - measured[1]))
        self._q, self._speed = q.copy(), speed
        return self._offset(q, speed, acceleration, gravity)

    def sag(self, q: np.ndarray, gravity: np.ndarray = DOWN) -> np.ndarray:
        """The same for joints that stand still at q [n]: what makes up for their sagging, rad."""
        still = np.zeros(len(q))
        return self._offset(q, still, still, gravity)

    def _offset(self, q: np.ndarray, speed: np.ndarray, acceleration: np.ndarray, gravity: np.ndarray) -> np.ndarray:
        self._model.pose(q)
        torque = self._model.torque(speed, acceleration, gravity)
        return (np.clip(torque, -self._effort, self._effort) + self._kd * speed) / self._kp
