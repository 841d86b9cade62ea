"""How well, how safely and how fast the arms follow wrist targets: inverse kinematics alone, no physics."""

from __future__ import annotations

import time
from collections import Counter

import mujoco
import numpy as np

from policies.reach import Reach, Reached
from robots.catalog import Robot

SECOND = 50
"""Ticks a second."""
NEAR = (0.25, np.deg2rad(60))
"""How far from home one move of a handle may take a wrist [m, rad]."""
ACCURATE = (0.010, np.deg2rad(3))
"""What counts as reached [m, rad]."""


def measure(robot: Robot, count: int = 1000, seed: int = 0) -> dict:
    """Solve for `count` pairs of targets and report.

    reachable: wrist errors one and two seconds after a jump from home to targets that the arms are known to reach, near home
    and anywhere. sweep: one target after the other, half of them wild (too far, inside the body, not a pose), each for half
    a second: exceptions, the deepest overlap of the robot's capsules on the way, limits and speeds. ik_ms: wall time of one
    tick in the sweep; ik_cpu_ms: the processor's share of it, for a busy machine.
    """
    bench = _Bench(robot, seed)
    few = max(count // 10, 1)
    return {
        "targets": count,
        "reachable": {"near": bench.accuracy(few, near=True), "anywhere": bench.accuracy(few, near=False)},
        "sweep": bench.sweep(count, ticks=SECOND // 2),
        "ik_ms": _percentiles(bench.wall),
        "ik_cpu_ms": _percentiles(bench.cpu),
    }


class _Bench:
    def __init__(self, robot: Robot, seed: int) -> None:
        self._reach, self._body = Reach(robot), _Body(robot)
        self._group = robot.spec.group("waist", "arms")
        self._spec, self._home = robot.spec, robot.spec.home[self._group]
        self._arms = [
            [i for i, j in enumerate(robot.spec.motors[self._group]) if j.name.startswith(f"{side}_")] for side in ("left", "right")
        ]
        self._rng = np.random.default_rng(seed)
        self.wall: list[float] = []
        self.cpu: list[float] = []

    def posture(self) -> np.ndarray:
        """Random arm angles [n] within the joint limits, waist at home, at which the body does not touch itself."""
        waist = [i for i, j in enumerate(self._spec.motors[self._group]) if j.group == "waist"]
        while True:
            q = self._rng.uniform(self._spec.lower[self._group], self._spec.upper[self._group])
            q[waist] = self._home[waist]
            if self._body.overlap(q) == 0.0:
                return q

    def reachable(self, near: bool) -> np.ndarray:
        """Two wrist poses [2, 7] that the arms can have at the same time."""
        return self._reach.forward(self._near() if near else self.posture())

    def _near(self) -> np.ndarray:
        """Like `posture`, with both wrists within `NEAR` of home."""
        home = self._reach.forward(self._home)
        while True:
            q, found = self._home.copy(), np.zeros(2, dtype=bool)
            while not found.all():
                other = self.posture()
                for arm in np.flatnonzero((_gaps(self._reach.forward(other), home) < NEAR).all(1)):
                    q[self._arms[arm]], found[arm] = other[self._arms[arm]], True
            if self._body.overlap(q) == 0.0:
                return q

    def wild(self) -> np.ndarray:
        """Two wrist poses [2, 7] anywhere in a box around the robot, its inside included; some are no poses at all."""
        wrists = np.empty((2, 7))
        wrists[:, :3] = self._rng.uniform([-0.7, -1.0, -0.6], [1.0, 1.0, 1.1], (2, 3))
        wrists[:, 3:] = self._rng.normal(size=(2, 4))
        wrists[:, 3:] /= np.linalg.norm(wrists[:, 3:], axis=1, keepdims=True)
        kind, side, at = self._rng.integers(12), self._rng.integers(2), self._rng.integers(7)
        if kind < 4:
            wrists[side, at] = (np.nan, np.inf, 1e30, -np.inf)[kind]
        elif kind == 4:
            wrists[side, 3:] *= 3.0
        elif kind == 5:
            wrists[side, :3] = (0.0, 0.0, self._rng.uniform(0.0, 0.6))
        return wrists

    def solve(self, wrists: np.ndarray) -> Reached:
        """One timed tick."""
        wall, cpu = time.perf_counter(), time.thread_time()
        reached = self._reach.solve(wrists)
        self.cpu.append(time.thread_time() - cpu)
        self.wall.append(time.perf_counter() - wall)
        return reached

    def accuracy(self, count: int, near: bool) -> dict:
        """Errors after one and two seconds."""
        errors = np.empty((2, count, 2, 2))
        for i in range(count):
            wrists = self.reachable(near)
            self._reach.reset(self._home)
            for second in errors[:, i]:
                for _ in range(SECOND):
                    reached = self._reach.solve(wrists)
                second[:] = reached.error
        return {"after_1_s": _summary(errors[0]), "after_2_s": _summary(errors[1])}

    def sweep(self, count: int, ticks: int) -> dict:
        """Safety on the way from target to target."""
        self._reach.reset(self._home)
        reasons, exceptions, deepest, beyond = Counter(), 0, 0.0, 0.0
        fastest, before = np.zeros(len(self._home)), self._home
        for i in range(count):
            wrists = self.reachable(near=False) if i % 2 else self.wild()
            for _ in range(ticks):
                try:
                    reached = self.solve(wrists)
                except Exception:  # counted: there must be none
                    exceptions += 1
                    break
                deepest = max(deepest, self._body.overlap(reached.q))
                past = np.maximum(self._spec.lower[self._group] - reached.q, reached.q - self._spec.upper[self._group])
                beyond = max(beyond, float(past.max()))
                fastest, before = np.maximum(fastest, np.abs(reached.q - before) * SECOND), reached.q
                reasons.update(reached.reasons)
        return {
            "exceptions": exceptions,
            "deepest_overlap_mm": 1e3 * deepest,
            "beyond_limits_rad": max(beyond, 0.0),
            "largest_share_of_motor_speed": float((fastest / self._spec.velocity[self._group]).max()),
            "fastest_joint_rad_s": float(fastest.max()),
            "reasons": dict(reasons),
        }


class _Body:
    """The robot that physics simulates, standing at home, to see where its own capsules overlap."""

    def __init__(self, robot: Robot) -> None:
        self._model = robot.model("training")
        self._data = mujoco.MjData(self._model)
        mujoco.mj_resetDataKeyframe(self._model, self._data, self._model.key("home").id)
        motors = robot.spec.motors[robot.spec.group("waist", "arms")]
        self._at = np.array([self._model.joint(j.name).qposadr[0] for j in motors])
        self._floor = np.flatnonzero(self._model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)

    def overlap(self, q: np.ndarray) -> float:
        """Depth of the deepest overlap at arm angles q [n], m; 0 where nothing touches."""
        self._data.qpos[self._at] = q
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_collision(self._model, self._data)
        contact = self._data.contact
        own = ~np.isin(contact.geom, self._floor).any(axis=1)
        return max(0.0, -float(contact.dist[own].min())) if own.any() else 0.0


def _gaps(wrists: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Distance [m] and angle [rad] between poses, left and right [2, 2]."""
    cosine = np.abs((wrists[:, 3:] * others[:, 3:]).sum(1)).clip(max=1.0)
    return np.stack([np.linalg.norm(wrists[:, :3] - others[:, :3], axis=1), 2 * np.arccos(cosine)], axis=1)


def _summary(errors: np.ndarray) -> dict:
    """Errors [..., 2] in mm and degrees."""
    place, turn = 1e3 * errors[..., 0], np.rad2deg(errors[..., 1])
    return {
        "position_mm": {"mean": float(place.mean()), "median": float(np.median(place))},
        "rotation_deg": {"mean": float(turn.mean()), "median": float(np.median(turn))},
        "reached": float((errors < ACCURATE).all(-1).mean()),
    }


def _percentiles(seconds: list[float]) -> dict:
    p50, p99 = np.percentile(1e3 * np.array(seconds), [50, 99])
    return {"p50": float(p50), "p99": float(p99)}
