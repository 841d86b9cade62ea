"""Inverse kinematics along a clip, for the stretches where the closed form jumps: near a shoulder singularity or a limit.

mink takes over shortly before the jump and follows wrist pose and elbow position within joint and speed limits until it meets the
closed form again.
"""

from __future__ import annotations

import mink
import mujoco
import numpy as np

from robots.catalog import Robot

LEAD = 0.3
"""Seconds before a jump at which inverse kinematics takes over."""
REJOINED = 0.2
"""Largest joint difference at which the closed form takes over again [rad]."""
PATIENCE = 0.5
"""Seconds after a jump at which an arm that has not met the closed form again turns back to it at half its joints' speed: an arm
that swung a full circle is caught in a corner of its limits."""
ITERATIONS = 2
"""Steps a frame; speed limits hold for their sum."""
WRIST, TURN, ELBOW, POSTURE = 1.0, 0.2, 0.5, 0.02
"""Costs of wrist position [1/m], wrist rotation [1/rad], elbow position [1/m] and of leaving the closed form [1/rad]."""


class Follower:
    """Both arms of a robot whose pelvis stands still at the origin."""

    def __init__(self, robot: Robot) -> None:
        group = robot.spec.group("waist", "arms")
        names = robot.spec.motor_names[group]
        self._model = _upper_body(robot, names)
        self._order = np.array([self._model.joint(name).qposadr[0] for name in names])
        self._data = mujoco.MjData(self._model)
        elbows = [f"{side}_elbow_pitch_link" for side in ("left", "right")]
        self._wrists = [mink.FrameTask(site, "site", WRIST, TURN, lm_damping=1e-3) for site in robot.spec.wrists]
        self._elbows = [mink.FrameTask(body, "body", ELBOW, 0.0, lm_damping=1e-3) for body in elbows]
        self._posture = mink.PostureTask(self._model, POSTURE)
        self._stride = robot.spec.velocity[group] / 2
        speed = dict(zip(names, robot.spec.velocity[group], strict=True))
        self._limits = [mink.ConfigurationLimit(self._model), mink.VelocityLimit(self._model, speed)]
        self._tasks = [[wrist, elbow, self._posture] for wrist, elbow in zip(self._wrists, self._elbows, strict=True)]
        self._bodies, self._sites = elbows, robot.spec.wrists

    def wrists(self, q: np.ndarray) -> np.ndarray:
        """Wrist positions in the pelvis frame [T, 2, 3] at waist and arm angles q [T, 15], m."""
        return np.stack([self._place(row, self._sites, "site") for row in q])

    def mend(self, closed: np.ndarray, held: np.ndarray, jumps: np.ndarray, rate: float) -> np.ndarray:
        """The clip without jumps.

        Args:
            closed: closed-form angles beyond the limits too [T, 15]: where wrists and elbows should be.
            held: the same held to the limits [T, 15]; returned where nothing jumps.
            jumps: frames at which the left and the right arm jumps [T, 2], bool.
            rate: frames a second.
        """
        out, lead = held.copy(), round(LEAD * rate)
        for side in range(2):
            t = 0
            while jumps[t:, side].any():
                first = t + int(np.argmax(jumps[t:, side]))
                t = self._take_over(out, closed, held, side, max(first - lead, t, 1), first, rate)
        return out

    def _take_over(self, out: np.ndarray, closed: np.ndarray, held: np.ndarray, side: int, start: int, jump: int, rate: float) -> int:
        """Write one arm's frames from `start` into `out` until the closed form is met after `jump`; the frame after the last."""
        arm = slice(1 + 7 * side, 8 + 7 * side)
        configuration, stride = mink.Configuration(self._model), self._stride[arm] / rate
        for t in range(start, len(out)):
            if t > jump + PATIENCE * rate:
                out[t, arm] = out[t - 1, arm] + np.clip(held[t, arm] - out[t - 1, arm], -stride, stride)
            else:
                out[t, arm] = self._solve(configuration, side, out[t - 1, arm], closed[t], held[t], 1 / (rate * ITERATIONS))
            if t > jump and np.abs(out[t, arm] - held[t, arm]).max() < REJOINED:
                return t + 1
        return len(out)

    def _solve(
        self, configuration: mink.Configuration, side: int, before: np.ndarray, closed: np.ndarray, held: np.ndarray, dt: float
    ) -> np.ndarray:
        """One arm's angles [7], started from those of the frame before."""
        columns = self._order[1 + 7 * side : 8 + 7 * side]
        q = self._aim(closed, held)
        q[columns] = before
        configuration.update(q)
        for _ in range(ITERATIONS):
            step = mink.solve_ik(configuration, self._tasks[side], dt, "daqp", 1e-4, limits=self._limits)
            configuration.integrate_inplace(step, dt)
        return configuration.q[columns]

    def _aim(self, closed: np.ndarray, held: np.ndarray) -> np.ndarray:
        """Tell the tasks where wrists and elbows should be; `held` in the model's joint order."""
        self._place(closed, self._sites, "site")
        for tasks, names, kind in ((self._wrists, self._sites, "site"), (self._elbows, self._bodies, "body")):
            for task, name in zip(tasks, names, strict=True):
                thing = getattr(self._data, kind)(name)
                matrix = thing.xmat.reshape(3, 3)
                task.set_target(mink.SE3.from_rotation_and_translation(mink.SO3.from_matrix(matrix), thing.xpos))
        q = np.empty(self._model.nq)
        q[self._order] = held
        self._posture.set_target(q)
        return q

    def _place(self, q: np.ndarray, names: tuple[str, ...] | list[str], kind: str) -> np.ndarray:
        self._data.qpos[self._order] = q
        mujoco.mj_kinematics(self._model, self._data)
        return np.array([getattr(self._data, kind)(name).xpos for name in names])


def _upper_body(robot: Robot, names: tuple[str, ...]) -> mujoco.MjModel:
    """The training model with only waist and arms left to move."""
    spec = robot.build("training")
    for rows in (spec.keys, spec.sensors, spec.actuators, spec.pairs):
        for row in list(rows):
            spec.delete(row)
    for joint in list(spec.joints):
        if joint.type == mujoco.mjtJoint.mjJNT_FREE:
            joint.parent.pos = (0, 0, 0)
        if joint.name not in names:
            spec.delete(joint)
    return spec.compile()
