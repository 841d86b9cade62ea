"""Steps the plant. A divergence is undone and reported, never a silent teleport."""

from __future__ import annotations

import logging
from collections.abc import Callable

import mujoco
import numpy as np

from app.mode import Reason
from robots.errors import PhysicsDiverged
from robots.plant import Plant
from robots.state import State
from robots.target import Target

_log = logging.getLogger(__name__)


class Physics:
    """The plant, and the last state of it that was good."""

    def __init__(self, plant: Plant, report: Callable[[Reason], None]) -> None:
        """`report` is called with the fault when the physics diverged."""
        self.plant, self._report = plant, report
        mujoco.set_mju_user_warning(_log.warning)  # otherwise it writes MUJOCO_LOG.TXT where the program was started
        self.before = plant.save()
        """The integration state before the newest step [nstate]."""
        self.time = 0.0
        """Simulated time before the newest step [s]."""
        self.jump = True
        """Whether `before` does not follow from the step before it."""
        self.was_set = True
        """Whether the state was set from outside since the newest step."""
        self._good = self.before
        self._sites = [plant.model.site(name).id for name in plant.spec.wrists]
        self._pelvis = plant.model.body(plant.spec.bodies[0].name).id

    def reset(self, seed: int = 0) -> State:
        """Put the robot back home, or near it (see Plant.reset)."""
        self.was_set = True
        return self.plant.reset(seed)

    def step(self, target: Target) -> State:
        """Simulate one tick, or go back to the last good state."""
        self.before, self.time = self.plant.save(), float(self.plant.data.time)
        self.jump, self.was_set = self.was_set, False
        try:
            state = self.plant.step(target)
        except PhysicsDiverged:
            self._report(Reason.PHYSICS_DIVERGED)
            return self._recover()
        if np.isfinite(self.before).all():
            self._good = self.before
        return state

    def wrists(self) -> np.ndarray:
        """Left and right wrist: position [m] and quaternion wxyz in the pelvis frame [2, 7]."""
        data, poses = self.plant.data, np.empty((2, 7))
        R_world_pelvis = data.xmat[self._pelvis].reshape(3, 3)
        for pose, site in zip(poses, self._sites, strict=True):
            pose[:3] = R_world_pelvis.T @ (data.site_xpos[site] - data.xpos[self._pelvis])
            mujoco.mju_mat2Quat(pose[3:], (R_world_pelvis.T @ data.site_xmat[site].reshape(3, 3)).ravel())
        return poses

    def _recover(self) -> State:
        """The last good state; home, when that one diverged again."""
        self.was_set = True
        return self.plant.reset() if self.jump else self.plant.restore(self._good)
