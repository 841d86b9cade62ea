"""What spring-like motors must be told beyond the angles: the torques that the joints of waist and arms need on the way.

The arms' motors are soft (140 N m/rad at a shoulder): under their own weight the wrists hang 21 mm low, and after a quick
move they swing for two seconds. Both are known in advance from the equations of motion, and so is how steps shake the arms from below,
once the pelvis's acceleration is felt. The rest is corrected by what is measured, with the torques that the joints' common inertia asks
for (computed torque control: Craig, Introduction to Robotics, chapter 10). Training, benches and the live robot move their arms by this.
"""

from __future__ import annotations

import numpy as np

from policies.arm_model import ArmModel
from robots.catalog import Robot
from robots.state import GRAVITY, State

STIFF, CALM = 80.0, 8.0
"""Accelerations against a deviation [1/s^2] and against its speed [1/s], beside the motor's own. With CALM at 12, fast motions of a
walking robot shake themselves up: what is measured is a tick old, and the pelvis gives way."""
WAIST = 0.75, 0.45
"""Shares of the waist's accelerations, known in advance and corrected: its motor turns the pelvis as much as the trunk, so the trunk's
inertia counts in part. More of the first shakes a robot that dances, less of it leaves the wrists behind; from 0.6 of the second on,
trunk and pelvis twist each other to and fro."""
SHOCK = 1.0
"""The arms make up for so much of the pelvis's acceleration at most, an axis [g]."""


class Feedforward:
    """Turns angles that waist and arms shall have into motor targets that make them have those angles, for `count` robots at once.

    The pelvis counts as unmoved but for what it feels along its axes, as an accelerometer there does. Its turning is left out: the
    waist's answer would turn the pelvis in its turn.
    """

    def __init__(self, robot: Robot, count: int = 1) -> None:
        spec, self._group = robot.spec, robot.spec.group("waist", "arms")
        self._model, self._rate = ArmModel(robot), robot.spec.policy_rate
        motors = spec.motors[self._group]
        self._known, self._corrected = np.array([WAIST if j.group == "waist" else (1.0, 1.0) for j in motors]).T
        self._kp, self._kd, self._effort = (np.array([getattr(j, key) for j in motors]) for key in ("kp", "kd", "effort"))
        self._lower, self._upper = spec.lower[self._group], spec.upper[self._group]
        self._q, self._speed = np.zeros((2, count, len(motors)))
        self._velocity, self._fresh = np.zeros((count, 3)), np.ones(count, bool)

    def reset(self, mask: np.ndarray | None = None) -> None:
        """Forget the past of the robots in the mask [count], or of all: their arms were at rest."""
        self._fresh[slice(None) if mask is None else mask] = True

    def step(self, q: np.ndarray, state: State) -> np.ndarray:
        """Motor targets [count, n] for the angles q [count, n] of this tick, rad, within the joint limits.

        state: of all robots, before the tick.
        """
        fresh = self._fresh
        self._q[fresh], self._speed[fresh], self._velocity[fresh] = q[fresh], 0, state.velocity[fresh]
        speed = (q - self._q) * self._rate
        acceleration = self._known * (speed - self._speed) * self._rate
        now = (self._q + q) / 2  # a target holds for a whole tick, so a joint that keeps up is half a tick behind its next one
        acceleration += self._corrected * (STIFF * (now - state.q[:, self._group]) + CALM * (speed - state.dq[:, self._group]))
        torque = self._torques(q, speed, acceleration, self._felt(state))
        self._q, self._speed, self._velocity = q.copy(), speed, state.velocity.copy()
        fresh[:] = False
        offset = (np.clip(torque, -self._effort, self._effort) + self._kd * speed) / self._kp
        return np.clip(q + offset, self._lower, self._upper)

    def _felt(self, state: State) -> np.ndarray:
        """What pulls at the arms: gravity less the pelvis's acceleration over the last tick [count, 3], g, in the pelvis frame."""
        acceleration = (state.velocity - self._velocity) * self._rate / GRAVITY
        return state.gravity - np.clip(state.in_pelvis(acceleration), -SHOCK, SHOCK)

    def _torques(self, q: np.ndarray, speed: np.ndarray, acceleration: np.ndarray, gravity: np.ndarray) -> np.ndarray:
        torques = np.empty_like(q)
        for i in range(len(q)):
            self._model.pose(q[i])
            torques[i] = self._model.torque(speed[i], acceleration[i], gravity[i])
        return torques
