"""Keeps a clip's arms out of the robot's own body: hands that hang at a person's sides would sink into the H1's wide hips."""

from __future__ import annotations

import numpy as np

from policies.arm_model import ArmModel
from policies.motion.smooth import low_pass
from robots.catalog import Robot

DISTANCE = 0.012
"""Distance that surfaces keep [m], as in teleoperation."""
PASSES, STEPS = 3, 3
"""Rounds of correct-then-smooth over a clip, and Newton steps a frame within one."""
FADE = 0.9
"""Share of a frame's correction with which the next frame starts: corrections set in and fade without a jump."""
CUTOFF = 4.0
"""Low-pass of the corrections [Hz]."""
WIDEN = 0.25
"""Seconds around a corrected frame that the next round looks at again."""
DAMPING = 1e-3
"""Added to the gradients' Gram matrix [m^2]: two opposed obstacles must not throw the arm about."""


class Clear:
    """Corrects clips of one robot whose legs stand at home."""

    def __init__(self, robot: Robot) -> None:
        group = robot.spec.group("waist", "arms")
        self._model = ArmModel(robot)
        self._lower, self._upper = robot.spec.lower[group], robot.spec.upper[group]
        self._arms = np.array([joint.group == "arms" for joint in robot.spec.motors[group]], dtype=float)

    def __call__(self, q: np.ndarray, rate: float) -> np.ndarray:
        """The clip [T, 15] with the arms moved as little as it takes to keep `DISTANCE`; frames that keep it stay as they are."""
        at_risk = np.ones(len(q), dtype=bool)
        for _ in range(PASSES):
            shift = self._shifts(q, at_risk)
            if not shift.any():
                break
            at_risk &= _widened(np.any(shift != 0, axis=-1), round(WIDEN * rate))
            q = np.clip(q + low_pass(shift, rate, CUTOFF), self._lower, self._upper)
        return q

    def overlaps(self, q: np.ndarray) -> np.ndarray:
        """Depth to which surfaces overlap in each frame of [T, 15], m; 0 where nothing touches."""
        depth = np.zeros(len(q))
        for t, row in enumerate(q):
            self._model.place(row)
            depth[t] = max(-self._model.clearance(), 0)
        return depth

    def _shifts(self, q: np.ndarray, at_risk: np.ndarray) -> np.ndarray:
        shifts = np.zeros_like(q)
        shift = np.zeros(q.shape[1])
        for t, row in enumerate(q):
            shift = shift * FADE
            shift[np.abs(shift) < 1e-4] = 0
            for _ in range(STEPS if at_risk[t] else 0):
                step = self._away(np.clip(row + shift, self._lower, self._upper))
                if step is None:
                    break
                shift = shift + step
            shifts[t] = shift
        return shifts

    def _away(self, q: np.ndarray) -> np.ndarray | None:
        """Smallest joint step that restores the distance, to first order; None if it is kept."""
        self._model.place(q)
        distance, gradient = self._model.obstacles()
        near = distance < DISTANCE
        if not near.any():
            return None
        rows = gradient[near] * self._arms
        return rows.T @ np.linalg.solve(rows @ rows.T + DAMPING * np.eye(len(rows)), DISTANCE - distance[near])


def _widened(mask: np.ndarray, by: int) -> np.ndarray:
    return np.convolve(mask, np.ones(2 * by + 1), mode="same") > 0
