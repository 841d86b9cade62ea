"""Arms: two wrist poses in, joint targets of waist and arms out, once a tick."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from policies.arm_model import ArmModel
from policies.arm_solver import ArmSolver, Blocked
from policies.detour import Detour
from policies.pose import wrist_poses
from policies.scout import Scout
from robots.catalog import Robot

ARRIVED = (0.005, 0.03)
"""An error below this needs no reason [m, rad]."""
CLOSING = 0.02
"""An arm whose error falls by this share in a tick is on its way."""


@dataclass(frozen=True)
class Reached:
    """What the arms do about two wrist targets."""

    q: np.ndarray
    """Joint targets of waist and arms in motor order [n], rad."""
    reachable: np.ndarray
    """The wrist poses that q attains: position [m] and quaternion wxyz in the pelvis frame [2, 7]."""
    reasons: tuple[str, str]
    """Why the left and the right wrist are not where they should be; "" if they are, or are on their way.

    invalid: the target is no pose, the arm holds. solver: no step was found, both arms hold. collision: the body is in
    the way. reach: the target is farther than the arm is long. limit: a joint is at its end. speed: a joint turns as fast
    as it may.
    """
    error: np.ndarray
    """Distance [m] and angle [rad] from `reachable` to the last valid target, left and right [2, 2]."""


class Reach:
    """Differential inverse kinematics of both arms. It follows its own joint targets; measured ones enter by `reset` only."""

    def __init__(self, robot: Robot, dt: float = 0.02, use_waist: bool = False) -> None:
        """dt: seconds between two calls of `solve`. use_waist: the waist helps the arms instead of standing as told."""
        spec, self._group = robot.spec, robot.spec.group("waist", "arms")
        motors = spec.motors[self._group]
        self._model = ArmModel(robot)
        self._solver = ArmSolver(robot, self._model, dt, use_waist)
        self._still = ArmModel(robot)
        """A second placement, for questions that must not move the arms."""
        self._yaw = next((i for i, j in enumerate(motors) if j.group == "waist" and abs(j.axis[2]) > 0.5), None)
        self._scout = Scout(robot)
        self._detours = [Detour(self._scout, arm) for arm in range(2)]
        self.reset(spec.home[self._group])

    def reset(self, q: np.ndarray) -> None:
        """Start from joint angles q [n] of waist and arms, rad; they are the posture until `solve` moves them."""
        self._solver.place(q)
        self._targets = self._model.wrists().tolist()
        self._solver.gaps = [0.0] * 4
        for arm, detour in enumerate(self._detours):
            detour.reset(self._targets[arm])
            self._solver.swing(arm, None)

    def solve(self, wrists: np.ndarray, waist: float = 0.0) -> Reached:
        """One tick towards two wrist poses [2, 7] in the pelvis frame and a waist yaw [rad]. Never raises, whatever it is given."""
        poses = wrist_poses(wrists)
        for arm, pose in enumerate(poses):
            if pose is not None:
                self._targets[arm] = pose
        if self._yaw is not None and math.isfinite(waist):
            self._solver.natural[self._yaw] = min(max(waist, self._solver.lower[self._yaw]), self._solver.upper[self._yaw])
        before, still = self._solver.gaps, (poses[0] is None, poses[1] is None)
        blocked = None if all(still) else self._solver.step(np.array(self._targets), still)
        reasons = [self._reason(i, blocked, before) if pose is not None else "invalid" for i, pose in enumerate(poses)]
        self._plan(reasons, before, blocked)
        gaps = np.array(self._solver.gaps).reshape(2, 2)
        return Reached(self._solver.q.copy(), self._model.wrists(), (reasons[0], reasons[1]), gaps)

    def _plan(self, reasons: list[str], before: list[float], blocked: Blocked | None) -> None:
        """Decide for the next tick which arm goes to its target and which one changes its posture first."""
        for arm, detour in enumerate(self._detours):
            if reasons[arm] == "invalid":
                continue
            swinging = detour.posture
            held = blocked is not None and (blocked.limit[arm] or blocked.collision[arm])
            mine = slice(2 * arm, 2 * arm + 2)
            detour.update(self._targets[arm], self._solver.q, self._solver.gaps[mine], before[mine], held)
            if detour.posture is not swinging:
                self._solver.swing(arm, detour.posture)

    def _reason(self, arm: int, blocked: Blocked | None, before: list[float]) -> str:
        if blocked is None:
            return "solver"
        distance, angle = self._solver.gaps[2 * arm : 2 * arm + 2]
        if distance <= ARRIVED[0] and angle <= ARRIVED[1]:
            return ""
        if distance < (1 - CLOSING) * before[2 * arm] or angle < (1 - CLOSING) * before[2 * arm + 1]:
            return "speed" if blocked.speed[arm] else ""
        if self._detours[arm].posture is not None:
            return ""
        if blocked.collision[arm]:
            return "collision"
        if math.dist(self._targets[arm][:3], self._model.shoulders()[arm].tolist()) > self._scout.lengths[arm]:
            return "reach"
        return "limit" if blocked.limit[arm] else "speed" if blocked.speed[arm] else "reach"

    def forward(self, q: np.ndarray) -> np.ndarray:
        """Wrist poses [2, 7] in the pelvis frame at joint angles q [n] of waist and arms, rad."""
        self._still.pose(q)
        return self._still.wrists()
