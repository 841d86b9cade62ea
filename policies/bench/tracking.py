"""Robots that play recorded motions while walking as the person did, and the paper's measures of it (section IV-A).

Each motion is played several times from slightly different starts, with the commands of its own base, clipped to the trained range,
until its end, 20 s or a fall. The arms' motors are told what the live robot's are. Deterministic policy, nominal physics, no sensor
noise. Means over a rollout's time, then over rollouts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from policies.bench.key_points import KeyPoints
from policies.envelope import HEIGHT, TWIST
from policies.feedforward import Feedforward
from policies.motion.clip import Clip, ClipSet
from policies.observation import ACTION_SCALE
from policies.walk import Walk
from robots.batch import Fleet
from robots.catalog import Robot
from robots.state import GRAVITY, State

LONGEST = 20.0
"""s"""
PUSH_EVERY = 5.0
"""s"""
MEASURES = {
    "acc_upper": "rad/s2",
    "action_upper": "rad",
    "kpe": "m",
    "jpe": "rad",
    "velocity": "(m/s)2",
    "angular": "(rad/s)2",
    "acc_lower": "rad/s2",
    "action_lower": "rad",
    "gravity": "m/s2",
}
"""The columns of the paper's table I, in its order, with their units."""


@dataclass(frozen=True)
class Conditions:
    """What the robots go through."""

    repeats: int = 5
    """Rollouts a motion."""
    seed: int = 0
    """Of starts and pushes."""
    push: float = 0.0
    """Sudden change of the horizontal velocity every 5 s, in a random direction [m/s]."""
    speed: float = 1.0
    """Playback speed of the motions; commands stay what they were."""


@dataclass(frozen=True)
class Score:
    """Of each rollout, in the order clip 0, clip 0, ..., clip 1: arrays [rollouts]."""

    survived: np.ndarray
    values: dict[str, np.ndarray]
    """`MEASURES`, and beside them: jpe_27 (over the fingers too, which keep still), kpe_pelvis, velocity_abs, angular_abs,
    reference_acc (the motion's own acc_upper; its action_upper is ours, for the targets are the motion)."""
    clipped: float
    """Share of the commands that was beyond the trained range."""

    def mean(self, all_rollouts: bool = True) -> dict[str, float]:
        """Means over the rollouts, or over those that did not fall, and the share that survived."""
        kept = np.ones(len(self.survived), bool) if all_rollouts else self.survived
        values = {name: round(float(value[kept].mean()), 5) for name, value in self.values.items()} if kept.any() else {}
        return {"survival": round(float(self.survived.mean()), 4)} | values


def track(robot: Robot, policy: str, clips: ClipSet, conditions: Conditions, progress: Callable[[float], None] = lambda _: None) -> Score:
    """Play every clip `repeats` times side by side; `progress` is told the share that is done."""
    motions = [motion for clip in clips.clips for motion in [_Motion(clip, conditions.speed)] * conditions.repeats]
    bench = _Tracking(robot, policy, motions, conditions)
    for tick in range(bench.ticks):
        bench.step(tick)
        if tick % 50 == 0:
            progress(tick / bench.ticks)
    return bench.score()


class _Motion:
    """A clip at a playback speed, at most 20 s of it."""

    def __init__(self, clip: Clip, speed: float) -> None:
        frames = np.arange(min(len(clip.q) / speed, LONGEST * clip.rate)) * speed
        low = np.minimum(frames.astype(int), len(clip.q) - 2)
        part = (frames - low)[:, None]
        self.q = (1 - part) * clip.q[low] + part * clip.q[low + 1]
        asked = clip.twist[low]
        self.twist = np.clip(asked, *TWIST)
        self.clipped = (self.twist != asked).any(-1).mean()
        self.height = clip.height[low]
        self.acceleration = np.zeros(len(self.q))
        """Mean over the joints of its size, rad/s^2; 0 in the first and the last frame, which have but one neighbour."""
        self.acceleration[1:-1] = np.abs(np.diff(self.q, 2, axis=0)).mean(-1) * clip.rate**2


class _Tracking:
    def __init__(self, robot: Robot, policy: str, motions: list[_Motion], conditions: Conditions) -> None:
        self._spec, self._conditions, n = robot.spec, conditions, len(motions)
        self._upper, self._legs = robot.spec.group("waist", "arms"), robot.spec.group("legs")
        self._dt = 1 / robot.spec.policy_rate
        self._rng = np.random.default_rng(conditions.seed)
        self._lengths = np.array([len(motion.q) for motion in motions])
        self.ticks = int(self._lengths.max())
        self._q, self._twist, self._height, self._acceleration = (
            _padded([getattr(motion, name) for motion in motions], self.ticks) for name in ("q", "twist", "height", "acceleration")
        )
        self._clipped = float(np.mean([motion.clipped for motion in motions]))
        self._points, self._fleet = KeyPoints(robot), Fleet(robot, n)
        self._walk, self._arms = Walk(robot, policy, n), Feedforward(robot, n)
        self._alive = np.ones(n, bool)
        self._sums: dict[str, np.ndarray] = {}
        self._counts = np.zeros(n)
        self._state = self._start()
        self._before = self._q[0], self._walk.action

    def _start(self) -> State:
        """Standing, arms where the motion begins, joints and base slightly off."""
        fleet, rng, n = self._fleet, self._rng, len(self._alive)
        fleet.reset(self._alive)
        fleet.qpos[:, fleet.senses.q[self._upper]] = self._q[0]
        fleet.qpos[:, fleet.senses.q[self._legs]] += rng.uniform(-0.02, 0.02, (n, 12))
        fleet.qvel[:, :2] = rng.uniform(-0.1, 0.1, (n, 2))
        self._walk.reset(self._q[0])
        return fleet.state()

    def step(self, tick: int) -> None:
        """One tick of all robots; those that are done or have fallen are no longer counted."""
        every = round(PUSH_EVERY / self._dt)
        if self._conditions.push and tick and tick % every == 0:
            angle = self._rng.uniform(0, 2 * np.pi, len(self._alive))
            self._fleet.qvel[:, :2] += self._conditions.push * np.stack([np.cos(angle), np.sin(angle)], -1)
        q, twist, n = self._q[tick], self._twist[tick], len(self._alive)
        before, posture = self._state, np.zeros((n, 3))
        posture[:, 0] = np.clip(self._height[tick], *HEIGHT)
        legs = self._walk.act(before, twist, posture, q)
        self._state = state = self._fleet.step(np.concatenate([legs, self._arms.step(q, before)], -1))
        counted = self._alive & (tick < self._lengths)
        self._alive &= ~(fallen(state, self._fleet) & counted)
        now = counted & self._alive
        if now.any():
            self._add(now, before, state, tick)
        self._before = q, self._walk.action

    def _add(self, now: np.ndarray, before: State, state: State, tick: int) -> None:
        upper, legs, dt, q = self._upper, self._legs, self._dt, self._q[tick]
        change = np.abs(state.dq - before.dq) / dt
        miss = np.abs(state.q[:, upper] - q)
        slow = state.heading_velocity - self._twist[tick][:, :2]
        turn = state.yaw_rate - self._twist[tick][:, 2]
        world, pelvis = np.zeros((2, len(now)))
        world[now], pelvis[now] = self._key_point_errors(now, state, tick)
        rows = {
            "acc_upper": change[:, upper].mean(-1),
            "action_upper": np.abs(q - self._before[0]).mean(-1),
            "kpe": world,
            "jpe": miss.mean(-1),
            "velocity": (slow**2).mean(-1),
            "angular": turn**2,
            "acc_lower": change[:, legs].mean(-1),
            "action_lower": ACTION_SCALE * np.abs(self._walk.action - self._before[1]).mean(-1),
            "gravity": GRAVITY * np.linalg.norm(state.gravity[:, :2], axis=-1),
            "jpe_27": miss.sum(-1) / 27,
            "kpe_pelvis": pelvis,
            "velocity_abs": np.abs(slow).mean(-1),
            "angular_abs": np.abs(turn),
            "reference_acc": self._acceleration[tick],
        }
        for name, value in rows.items():
            self._sums.setdefault(name, np.zeros(len(now)))[now] += value[now]
        self._counts += now

    def _key_point_errors(self, now: np.ndarray, state: State, tick: int) -> tuple[np.ndarray, np.ndarray]:
        """Mean distance of the six points from the motion's: as ExBody has it (the reference upright at its own height, with the
        robot's place and heading), and in the pelvis frame [now.sum()], m."""
        wanted, found = self._points(self._q[tick][now]), self._points(state.q[now, self._upper])
        pelvis = np.linalg.norm(wanted - found, axis=-1).mean(-1)
        upright = _turned(state.quaternion[now], state.yaw[now], found)
        lift = np.zeros((len(wanted), 1, 3))
        lift[:, 0, 2] = state.position[now, 2] - self._height[tick][now]
        return np.linalg.norm(upright + lift - wanted, axis=-1).mean(-1), pelvis

    def score(self) -> Score:
        """What came of it."""
        counts = np.maximum(self._counts, 1)
        return Score(self._alive.copy(), {name: total / counts for name, total in self._sums.items()}, self._clipped)


def fallen(state: State, fleet: Fleet) -> np.ndarray:
    """Which robots lie, or fly apart [n]."""
    return state.fallen(0.5 * fleet.spec.nominal_height) | ~fleet.finite


def _padded(rows: list[np.ndarray], ticks: int) -> np.ndarray:
    """[T_i, ...] of every robot, the last one held -> [ticks, robots, ...]."""
    return np.stack([row[np.minimum(np.arange(ticks), len(row) - 1)] for row in rows], 1)


def _turned(quaternion: np.ndarray, yaw: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points in the pelvis frame [n, 6, 3] as seen in the heading frame at the pelvis."""
    w, v = quaternion[:, None, :1], quaternion[:, None, 1:]
    t = 2 * np.cross(v, points)
    world = points + w * t + np.cross(v, t)
    c, s = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    return np.stack([c * world[..., 0] + s * world[..., 1], c * world[..., 1] - s * world[..., 0], world[..., 2]], -1)
