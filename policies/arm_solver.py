"""One tick of inverse kinematics: the joint step that a small quadratic program chooses, checked before it is taken.

mink solves the same kind of program, without the check. Measured side by side it takes 1.6 times as long, and its collision
rows (1.3) allow 1/dt times the step they mean to allow: two arms sank 62 mm into each other.
Here vectors of three or four numbers are Python floats on purpose: an array operation on them costs ten times as much.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import daqp
import numpy as np

from policies.arm_model import ArmModel
from robots.catalog import Robot

SPEED_SHARE, TOP_SPEED = 0.6, 6.0
"""A joint uses at most this share of its motor's speed, and never more than this [rad/s]."""
GAIN = 0.6
"""Share of the error that one tick removes: a wrist follows a steady drag 13 ms behind."""
WEIGHTS = (1.0, 0.1)
"""Weights of a wrist's translation [1/m] and rotation [1/rad]: where both cannot be had, place goes first."""
BOUNDS = (0.12, 0.5)
"""Errors beyond this pull no harder [m, rad]: a target a kilometre away must not outvote the elbow or the other arm."""
LEVER = (0.6, 1.0)
"""How fast the directions of those pulls turn with the joints [m/rad, 1]."""
DAMPING, FIRM = 0.05, 0.2
"""Share of the curvature by that turning which is added to the joints' own: keeps a stretched arm from trembling. And the
share of this damping by which the natural posture pulls harder: an elbow settles at once where a target cannot be had."""
POSTURE, HOLD, SHARED = 0.006, 10.0, 0.05
"""Weights of the natural posture [1/rad]: an arm joint's, and the waist's when it stands still or helps the arms."""
DISTANCE, FLOOR = 0.012, 0.004
"""Distance that the parts of the body keep [m], and the one that no step goes below."""
APPROACH = 0.5
"""Share of the distance that is left which one tick may use up."""
SWING, SWING_SPEED = 1.0, 0.7
"""Weight of the posture that an arm swings to [1/rad], and the share of its speed that it swings with."""
SMALLEST = 1 / 64
"""A step that is still refused when cut to this share is not taken."""
REST = 1e-8
"""A step that lowers the cost by less is not worth a movement: 0.14 mm, 0.05 degrees."""
LEAN = 1e-6
"""A bound that is pushed less than this does not hold the arm back."""
NEVER = 1e30
"""daqp's infinity."""


@dataclass(frozen=True)
class Blocked:
    """What held the left and the right arm back in one step."""

    collision: Sequence[bool]
    limit: Sequence[bool]
    speed: Sequence[bool]


class Step(NamedTuple):
    """What the quadratic program found."""

    joints: np.ndarray
    """Turn of every joint [n], rad."""
    forces: np.ndarray
    """How hard the step leans on the bounds of the joints and on the obstacles [n + k]."""
    promise: float
    """The cost that the step would save if the cost were a plane."""


class ArmSolver:
    """Joint targets that walk towards two wrist poses, one `step` a tick."""

    def __init__(self, robot: Robot, model: ArmModel, dt: float, use_waist: bool) -> None:
        spec, group = robot.spec, robot.spec.group("waist", "arms")
        self.model, self.size = model, model.size
        self.lower, self.upper = spec.lower[group], spec.upper[group]
        self._fastest = np.minimum(SPEED_SHARE * spec.velocity[group], TOP_SPEED) * dt
        self._stride, self._home = self._fastest.copy(), spec.home[group]
        waist = np.array([j.group == "waist" for j in spec.motors[group]])
        self._posture = np.where(waist, SHARED if use_waist else HOLD, POSTURE) ** 2
        self._arms = model.arms & ~waist
        self._moved = model.arms.astype(float)
        self._side = [None if left and right else int(right) for left, right in model.arms.T.tolist()]
        self._weights = np.repeat(np.square(WEIGHTS * 2), 3)[:, None].repeat(self.size, axis=1)
        self.natural = spec.home[group].copy()
        """The posture that the arms would like best [n], rad."""
        self.gaps = [0.0] * 4
        """Left distance [m] and angle [rad] to the target after the last step, right ones."""
        self.place(spec.home[group])

    def place(self, q: np.ndarray) -> None:
        """Stand at q [n], rad."""
        self.q = np.clip(q, self.lower, self.upper)
        self.model.place(self.q)

    def swing(self, arm: int, posture: np.ndarray | None) -> None:
        """Let an arm go to a posture [n] before it cares for its target, or (None) back to its target at once."""
        joints = self._arms[arm]
        self.natural[joints] = (self._home if posture is None else posture)[joints]
        self._posture[joints] = (POSTURE if posture is None else SWING) ** 2
        self._stride[joints] = self._fastest[joints] * (1.0 if posture is None else SWING_SPEED)

    def step(self, wrists: np.ndarray, still: tuple[bool, bool] = (False, False)) -> Blocked | None:
        """Move `q` one tick towards the poses [2, 7], without the arms marked `still`; None if no step was found."""
        errors = self.model.errors(wrists)
        self.gaps = _sizes(errors)
        lower, upper = np.maximum(self.lower - self.q, -self._stride), np.minimum(self.upper - self.q, self._stride)
        for arm, frozen in zip(self._arms, still, strict=True):
            if frozen:
                lower[arm] = upper[arm] = 0.0
        distance, gradient = self.model.obstacles()
        found = self._solve(errors, lower, upper, distance, gradient)
        if found is None:
            return None
        blocked = self._blocked(lower, upper, found.forces, gradient)
        self._take(np.minimum(np.maximum(found.joints, lower), upper), found.promise, wrists)
        return blocked

    def _solve(self, errors: np.ndarray, lower: np.ndarray, upper: np.ndarray, distance: np.ndarray, gradient: np.ndarray) -> Step | None:
        """The step that the cost and the bounds make best."""
        jacobian = self.model.jacobian()
        weighted = jacobian * self._weights
        hessian = weighted.T.dot(jacobian)
        shares, damping = _pull(self.gaps)
        diagonal = hessian.reshape(-1)[:: self.size + 1]
        turning = damping.dot(self._moved)
        self._bend = self._posture + FIRM * turning
        diagonal += self._bend
        diagonal += turning
        slope = self._bend * (self.q - self.natural)
        slope -= (errors * shares).dot(weighted)
        slope *= GAIN
        if not len(distance):
            return _minimum(hessian, slope, gradient, lower, upper)
        high = np.concatenate([upper, np.full(len(distance), NEVER)])
        least = APPROACH * (DISTANCE - distance)
        yielding = np.minimum(least, 0.0)
        if self.model.clearance() <= FLOOR:  # parts come apart, unless that is impossible
            found = _minimum(hessian, slope, gradient, np.concatenate([lower, least]), high)
            if found is not None:
                return found
        return _minimum(hessian, slope, gradient, np.concatenate([lower, yielding]), high)

    def _take(self, step: np.ndarray, promise: float, wrists: np.ndarray) -> None:
        """Take the step, or the largest quarter of a quarter of it that lowers the cost and does not let the body touch itself."""
        start, cost, near = self.q, self._cost(self.q), self.model.clearance()
        floor, share = min(near, FLOOR), 1.0
        while share >= SMALLEST and (share * promise > 2 * REST or near < FLOOR):  # half of it may be lost to curvature
            self.q = start + share * step
            self.model.place(self.q)
            self.gaps, clear = _sizes(self.model.errors(wrists)), self.model.clearance()
            apart = near < clear < FLOOR  # parts that overlap may leave the targets to come apart
            if clear >= floor and (apart or self._cost(self.q) < cost - REST):
                return
            share /= 4
        if self.q is not start:
            self.q = start
            self.model.place(start)
            self.gaps = _sizes(self.model.errors(wrists))

    def _cost(self, q: np.ndarray) -> float:
        """What `_solve` makes smaller: the squares of the gaps up to their bounds, straight lines beyond."""
        bent, cost = q - self.natural, 0.0
        for gap, weight, bound in zip(self.gaps, WEIGHTS * 2, BOUNDS * 2, strict=True):
            pull = gap if gap < bound else bound
            cost += weight * weight * pull * (gap - pull / 2)
        return cost + 0.5 * float(self._bend.dot(bent * bent))

    def _blocked(self, lower: np.ndarray, upper: np.ndarray, forces: np.ndarray, gradient: np.ndarray) -> Blocked:
        """Which arm leans on which kind of bound."""
        collision, limit, speed = [False, False], [False, False], [False, False]
        for i, force in enumerate(forces.tolist()):
            if abs(force) < LEAN:
                continue
            if i >= self.size:
                for arm, joints in enumerate(self._arms):
                    collision[arm] |= bool(gradient[i - self.size, joints].any())
                continue
            side, room = self._side[i], upper[i] if force > 0 else -lower[i]
            if side is not None and lower[i] < upper[i]:
                (speed if room >= self._stride[i] else limit)[side] = True
        return Blocked(collision, limit, speed)


def _minimum(hessian: np.ndarray, slope: np.ndarray, rows: np.ndarray, low: np.ndarray, high: np.ndarray) -> Step | None:
    """daqp's answer, or None if it has none or not a finite one."""
    try:
        step, _, flag, info = daqp.solve(hessian, slope, np.ascontiguousarray(rows), high, low)
    except Exception:  # whatever the solver does, the arms hold
        return None
    if flag < 1 or not math.isfinite(step.dot(step)):
        return None
    return Step(step, info["lam"], -float(slope.dot(step)) / GAIN)


def _sizes(errors: np.ndarray) -> list[float]:
    """Lengths of the four vectors in `ArmModel.errors`."""
    e = errors.tolist()
    return [math.hypot(*e[i : i + 3]) for i in (0, 3, 6, 9)]


def _pull(gaps: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """Share of each error that pulls [12], and the damping of each arm [2] by the pulls' turning."""
    shares, turns = [], []
    for gap, weight, bound, lever in zip(gaps, WEIGHTS * 2, BOUNDS * 2, LEVER * 2, strict=True):
        pull, share = (gap, 1.0) if gap < bound else (bound, bound / gap)
        shares += (share, share, share)
        turns.append(DAMPING * pull * weight * weight * lever)
    both = np.array([*shares, turns[0] + turns[1], turns[2] + turns[3]])
    return both[:12], both[12:]
