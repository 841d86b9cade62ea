"""One simulated robot: a Target goes in, physics steps, a State comes out."""

from __future__ import annotations

import mujoco
import numpy as np

from robots.catalog import Robot, Variant
from robots.errors import PhysicsDiverged
from robots.senses import Senses
from robots.state import State
from robots.target import Target

PLACE, HEADING, ARMS = 0.15, np.deg2rad(20), 0.12
"""How far a varied start is from home: along x and y [m], about the vertical [rad], each arm joint [rad]."""


class Plant:
    """A robot standing at home, stepped one policy tick (1 / `policy_rate`) at a time."""

    def __init__(self, robot: Robot, variant: Variant = "play") -> None:
        self.spec = robot.spec
        self.model = robot.model(variant)
        self.data = mujoco.MjData(self.model)
        self.substeps = round(1 / (robot.spec.policy_rate * self.model.opt.timestep))
        self._senses = Senses(self.model, robot.spec)
        self.reset()

    def reset(self, seed: int = 0) -> State:
        """Back to the home key frame at time 0. A seed other than 0 draws place, heading and arms near it, always the same ones."""
        mujoco.mj_resetDataKeyframe(self.model, self.data, self.model.key("home").id)
        if seed:
            self._vary(np.random.default_rng(seed))
        mujoco.mj_forward(self.model, self.data)
        return self.state()

    def state(self) -> State:
        """What the robot senses now."""
        d = self.data
        return self._senses.read(np.array(d.time), d.qpos, d.qvel, d.sensordata)

    def step(self, target: Target) -> State:
        """Aim the motors and simulate one tick.

        Raises:
            PhysicsDiverged: MuJoCo raised a warning, a number is not finite or time did not advance.
        """
        before, warned = self.data.time, self.data.warning.number.sum()
        self.data.ctrl[:] = target.q[: self.model.nu]
        mujoco.mj_step(self.model, self.data, nstep=self.substeps)
        finite = np.isfinite(self.data.qpos).all() and np.isfinite(self.data.qvel).all()
        if not finite or self.data.time <= before or self.data.warning.number.sum() > warned:
            raise PhysicsDiverged(f"the simulation diverged at t = {before:.2f} s")
        return self.state()

    def save(self) -> np.ndarray:
        """The full integration state, for `restore` and for recordings."""
        kind = mujoco.mjtState.mjSTATE_INTEGRATION
        row = np.empty(mujoco.mj_stateSize(self.model, kind))
        mujoco.mj_getState(self.model, self.data, row, kind)
        return row

    def restore(self, row: np.ndarray) -> State:
        """Continue from a row that `save` returned, bit for bit; the row must come from the same model.

        Sensors are computed afresh here: in the State that is returned they are one physics step newer than in `step`'s.
        """
        mujoco.mj_setState(self.model, self.data, row, mujoco.mjtState.mjSTATE_INTEGRATION)
        mujoco.mj_forward(self.model, self.data)
        return self.state()

    def _vary(self, random: np.random.Generator) -> None:
        qpos, arms = self.data.qpos, self.spec.group("arms")
        place, yaw = random.uniform(-PLACE, PLACE, 2), random.uniform(-HEADING, HEADING)
        angles = self.spec.home[arms] + random.uniform(-ARMS, ARMS, arms.stop - arms.start)
        qpos[:2] += place
        mujoco.mju_axisAngle2Quat(qpos[3:7], np.array([0.0, 0.0, 1.0]), yaw)  # upright at home
        qpos[self._senses.q[arms]] = np.clip(angles, self.spec.lower[arms], self.spec.upper[arms])
