"""The training ground: many H1s whose arms do as they please while the legs obey velocity and posture commands."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace

import numpy as np

from policies.envelope import HEIGHT, POSTURE, TWIST, next_posture
from policies.feedforward import Feedforward
from policies.gait import PERIOD, Gait
from policies.motion.clip import ClipSet
from policies.motion.playback import Playback
from policies.observation import Mirror, Observer, joint_mirror, layout, leg_targets
from policies.ppo.randomise import randomise
from policies.ppo.rewards import Moment, Rewards, foot_heights
from policies.prior.latent import Latent
from policies.prior.prior import Prior
from policies.stance import Stance
from robots.batch import Fleet
from robots.catalog import Robot
from robots.spec import RobotSpec
from robots.state import State

TILT_LIMIT = np.cos(np.radians(45))
LOW = 0.6
"""Pelvis height that counts as a fall while training [m]."""
NOISE = {"gyro": 0.1, "quaternion": 0.015, "q": 0.01, "dq": 0.5, "feet_velocity": 0.05}
"""Half-widths of the uniform sensor noise."""
STILL = 0.08
"""Velocity commands below this ask to stand [m/s, rad/s]."""
HURRY = 1.5
"""How many times faster the arms play a motion at most, which makes foresight worth more; the commands for the feet keep their size."""
FOLLOW = 0.5
"""Share of the robots that are told to move over the ground as the person in their clip did."""


@dataclass(frozen=True)
class Stage:
    """How hard the training ground is."""

    name: str
    steps: float
    """Steps after which the next stage begins even if its gate was not passed."""
    stand: float = 0.2
    """Share of commands that ask to stand."""
    vx: tuple[float, float] = (TWIST[0, 0], TWIST[1, 0])
    """m/s"""
    vy: float = TWIST[1, 1]
    """m/s"""
    yaw: float = TWIST[1, 2]
    """rad/s"""
    push: float = 0.8
    """Largest velocity push [m/s]."""
    arms: bool = True
    """Whether the arms move, each motion with the amplitude that it has earned."""
    posture: float = 0.0
    """Share of commands that ask for roll, pitch and height."""

    def clip(self, twist: np.ndarray) -> np.ndarray:
        """Velocities [n, 3] within what is trained; what is hardly a motion is none."""
        limit = np.array([self.vx, (-self.vy, self.vy), (-self.yaw, self.yaw)]).T
        return np.where(np.abs(twist) < STILL, 0, np.clip(twist, *limit))


class WalkEnv:
    """`count` robots. `step` takes actions [count, 12] and returns what a learner needs."""

    def __init__(
        self, robot: Robot, motions: ClipSet, prior: Prior | None, count: int, seed: int, seconds: float = 12.0, threads: int = 0
    ) -> None:
        """motions: what the arms do. prior: makes z of it; without one z is 0."""
        self.spec, self.count = robot.spec, count
        self.rng = np.random.default_rng(seed)
        self.dt = 1 / robot.spec.policy_rate
        self.length = round(seconds / self.dt)
        self.fleet = Fleet(robot, count, threads)
        self._known = randomise(self.fleet, self.rng)
        self.gait, self.observer = Gait(count, self.dt), Observer(robot.spec, count)
        self.stance = Stance(robot)
        self.playback = Playback(robot.spec, motions, count, self.rng, fastest=HURRY)
        self._latent, self._rewards = Latent(robot.spec, prior, count), Rewards(robot.spec)
        self._arms, self._state = Feedforward(robot, count), self.fleet.state()
        self._upper = np.tile(self.playback.home, (count, 1))
        self.penalty = 0.1
        self.stage = Stage("none", 0)
        self._late = self.rng.random(count) < 0.1  # these robots act one tick late
        self._follows = self.rng.random(count) < FOLLOW
        self._legs = robot.spec.group("legs")
        zeros = lambda *shape: np.zeros((count, *shape))  # noqa: E731
        self.twist, self._posture, self._posture_goal = zeros(3), zeros(3), zeros(3)
        self._mean = zeros(3)
        self._actions = (zeros(12), zeros(12), zeros(12))
        self.age, self._recommand, self._push_in, self._since_push = zeros().astype(int), zeros(), zeros(), zeros()
        self.log: dict[str, list[float]] = defaultdict(list)

    @property
    def mirrors(self) -> tuple[Mirror, Mirror]:
        """Mirrors of the actor's observation and of the critic's."""
        actor = Mirror.stack(list(layout(self.spec).values()))
        return actor, Mirror.stack([actor, privileged_mirror(self.spec)])

    def start(self, stage: Stage) -> tuple[np.ndarray, np.ndarray]:
        """Begin a stage with every robot reset, ages spread so that episodes do not end together."""
        self.stage = stage
        self._reset(np.ones(self.count, bool), np.zeros(self.count, bool))
        self.age = self.rng.integers(0, self.length, self.count)
        return self._observe(self.fleet.state())

    def step(self, action: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """One tick: (observation, critic's extra, reward [n], ended [n], timed out [n])."""
        self._push()
        self._actions = (action, *self._actions[:2])
        acted = np.where(self._late[:, None], self._actions[1], action)
        before = self.fleet.qvel[:, self.fleet.senses.dq[self._legs]].copy()
        legs, arms = leg_targets(self.spec, self.stance(self._posture), acted), self._arms.step(self._upper, self._state)
        state = self.fleet.step(np.concatenate([legs, arms], -1))
        acceleration = (state.dq[:, self._legs] - before) / self.dt
        self.gait.step(state, self.twist)
        self.age += 1
        self._since_push += self.dt
        reward, fell = self._judge(state, acceleration)
        late = self.age >= self.length
        ended = fell | late
        self._command()
        if ended.any():
            self.log["survived"] += (self.age[ended] / self.length).tolist()
            self._reset(ended, fell)
            state = self.fleet.state()
        observation, extra = self._observe(state)
        return observation, extra, reward, ended, late & ~fell

    def _judge(self, state: State, acceleration: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        actual = np.column_stack([state.heading_velocity, state.yaw_rate])
        self._mean += self.dt / (self.dt + PERIOD / 2) * (actual - self.twist - self._mean)
        moment = Moment(
            state,
            self.gait,
            self.twist,
            self._posture,
            self.stance(self._posture),
            self._mean,
            self._actions,
            acceleration,
            self._since_push < 1.5,
        )
        fell = (state.gravity[:, 2] > -TILT_LIMIT) | (state.position[:, 2] < LOW) | ~self.fleet.finite
        terms = self._rewards.tasks(moment)
        costs = {name: self.penalty * value for name, value in self._rewards.penalties(moment).items()}
        reward = np.maximum(sum(terms.values()) + sum(costs.values()), 0) * self.dt - 2.0 * fell
        for name, value in (terms | costs).items():
            self.log[name].append(float(np.nanmean(value)))
        walking, air = self.gait.walking, ~state.contact
        wanted = np.abs(self.twist).max(-1) > 0.05
        for name, value, mask in (
            ("air_walking", air.mean(-1), walking),
            ("air_standing", air.mean(-1), ~walking),
            ("stepping_idle", walking, ~wanted),
            ("error_vx", np.abs(self._mean[:, 0]), wanted),
            ("error_vy", np.abs(self._mean[:, 1]), wanted),
            ("error_yaw", np.abs(self._mean[:, 2]), wanted),
        ):
            if mask.any():
                self.log[name].append(float(np.nanmean(value[mask])))
        return np.nan_to_num(reward, nan=-2.0), fell

    def _push(self) -> None:
        self._push_in -= self.dt
        due = self._push_in <= 0
        count = int(due.sum())
        if not count:
            return
        angle, size = self.rng.uniform(0, 2 * np.pi, count), self.rng.uniform(0, self.stage.push, count)
        self.fleet.qvel[due, 0] += size * np.cos(angle)
        self.fleet.qvel[due, 1] += size * np.sin(angle)
        self._push_in[due] = self.rng.uniform(3, 6, count)
        self._since_push[due] = 0

    def _command(self) -> None:
        self._recommand -= self.dt
        self._draw_commands(self._recommand <= 0)
        if self.stage.arms:
            follows = self._follows
            self.twist[follows] = self.stage.clip(self.playback.twist()[follows])
            self._posture_goal[follows, 0] = np.clip(self.playback.height()[follows], *HEIGHT)
        self._posture = next_posture(self._posture, self._posture_goal, self.dt)

    def _draw_commands(self, mask: np.ndarray) -> None:
        n, stage, rng = int(mask.sum()), self.stage, self.rng
        if not n:
            return
        twist = np.column_stack([rng.uniform(*stage.vx, n), rng.uniform(-stage.vy, stage.vy, n), rng.uniform(-stage.yaw, stage.yaw, n)])
        kind = rng.random(n)
        twist[kind < 0.4, 1:] = 0  # straight
        twist[(kind > 0.4) & (kind < 0.55), ::2] = 0  # sideways
        twist[(kind > 0.55) & (kind < 0.7), :2] = 0  # turn
        twist[rng.random(n) < stage.stand] = 0
        self.twist[mask] = stage.clip(twist)
        low, high = POSTURE
        posture = np.column_stack([rng.uniform(low[0], high[0], n), rng.uniform(low[1:], high[1:], (n, 2))])
        lean = rng.random(n) < stage.posture
        self._posture_goal[mask] = np.where(lean[:, None], posture, [self.spec.nominal_height, 0, 0])
        self._recommand[mask] = rng.uniform(3, 8, n)

    def _reset(self, mask: np.ndarray, fell: np.ndarray) -> None:
        n, rng, fleet = int(mask.sum()), self.rng, self.fleet
        fleet.reset(mask)
        yaw = rng.uniform(-np.pi, np.pi, n)
        fleet.qpos[mask, 3:7] = np.column_stack([np.cos(yaw / 2), np.zeros((n, 2)), np.sin(yaw / 2)])
        fleet.qpos[mask, 7:] += rng.uniform(-0.05, 0.05, (n, fleet.qpos.shape[1] - 7))
        fleet.qvel[mask, :3] = rng.uniform(-0.2, 0.2, (n, 3))
        self.gait.reset(mask)
        self.observer.reset(mask)
        self._arms.reset(mask)
        if self.stage.arms:
            self.playback.reset(mask, fell)
        self._latent.reset(mask, np.tile(self.playback.home, (self.count, 1)))
        for array in (*self._actions, self._mean):
            array[mask] = 0
        self.age[mask] = 0
        self._draw_commands(mask)
        self._posture[mask] = self._posture_goal[mask]
        self._push_in[mask] = rng.uniform(1, 6, n)
        self._since_push[mask] = 10

    def _observe(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        self._state = state
        if self.stage.arms:
            self._upper = self.playback.step()  # where the arms go in the tick that this observation decides
        seen = replace(state, **{k: getattr(state, k) + self.rng.uniform(-w, w, getattr(state, k).shape) for k, w in NOISE.items()})
        observation = self.observer.observe(
            seen, self.gait, self.twist, self._posture, self.stance(self._posture), self._actions[0], self._latent.step(self._upper)
        )
        height = (foot_heights(state) * 10).astype(np.float32)
        body = np.column_stack([state.heading_velocity, state.velocity[:, 2], state.position[:, 2] - 1, self._mean])
        ahead = self.stage.arms * (self.playback.at(0.3) - self._upper)
        extra = [body, height, state.touch / 300, self._known, self.playback.amplitude[:, None], ahead]
        return observation, np.nan_to_num(np.concatenate(extra, -1)).astype(np.float32)


def privileged_mirror(spec: RobotSpec) -> Mirror:
    """Mirror of what only the critic sees."""
    body = Mirror.signs(1, -1, 1, 1, 1, -1, -1)
    feet = Mirror.pairs(1, 2)
    known = Mirror.signs(1, 1, 1, -1, 1, -1)
    return Mirror.stack([body, feet, known, Mirror.signs(1), joint_mirror(spec, spec.group("waist", "arms"))])
