"""Many copies of a robot stepped on a thread pool (mjbatch), for training and for benches."""

from __future__ import annotations

import numpy as np
from mjbatch import Batch

from robots.catalog import Robot
from robots.senses import Senses
from robots.state import State


class Fleet:
    """`count` training models of one robot. Arrays have the robot as their first dimension."""

    def __init__(self, robot: Robot, count: int, threads: int = 0) -> None:
        self.spec = robot.spec
        self.model = robot.model("training")
        self.count = count
        self.substeps = round(1 / (robot.spec.policy_rate * self.model.opt.timestep))
        self.batch = Batch(self.model, count, threads)
        self.qpos, self.qvel = self.batch.bind("qpos"), self.batch.bind("qvel")
        self.ctrl, self.time = self.batch.bind("ctrl"), self.batch.bind("time")
        self._sensordata = self.batch.bind("sensordata")
        self.senses = Senses(self.model, robot.spec)

    def reset(self, mask: np.ndarray) -> None:
        """Put the robots of a boolean mask [count] back to the home key frame, at time 0, with fresh sensors."""
        if mask.any():
            self.batch.reset(mask, keyframe=self.model.key("home").id)

    def step(self, q: np.ndarray) -> State:
        """Aim every motor at q [count, 27] and simulate one tick."""
        self.ctrl[:] = q
        self.batch.step(nstep=self.substeps)
        return self.state()

    def state(self) -> State:
        """What every robot senses now."""
        return self.senses.read(self.time.reshape(self.count), self.qpos, self.qvel, self._sensordata)

    @property
    def finite(self) -> np.ndarray:
        """Robots whose physics is still finite, and slower than 1000 rad/s in every joint [count]."""
        return np.isfinite(self.qpos).all(-1) & np.isfinite(self.qvel).all(-1) & (np.abs(self.qvel).max(-1) < 1e3)
