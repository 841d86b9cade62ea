"""`teleop-train synthetic`: made-up teleoperation, so that everything trains without any download.

Both wrists make min-jerk reaches in SE(3) through the same inverse kinematics as an operator's hands. Displacements, peak speeds
and rests are drawn from distributions measured on people's sub-movements (manipulation, gesture, sport); a third of the clips adds
the arm swing of walking. `TARGET` says which wrist speeds must come out of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track
from scipy.spatial.transform import Rotation

from policies.motion.clip import Clip, ClipSet
from policies.motion.smooth import low_pass
from policies.reach import Reach
from robots import catalog
from robots.catalog import Robot

TARGET = {50: 0.32, 90: 1.27, 99: 2.79}
"""Percentiles of people's wrist speed in the chest frame while they handle things [m/s]."""
TOLERANCE = 0.15

DISPLACEMENT = (0.13, 1.1, 0.9)
"""Length of a reach: log-normal median [m], sigma, and cap [m]."""
PEAK_SPEED = (0.73, 0.85, 3.5)
"""Its peak speed: log-normal median [m/s], sigma, and cap [m/s]."""
TOGETHERNESS = 0.83
"""Correlation of the two logarithms: long reaches are fast, so that durations spread by only 0.6 (people: 0.13 to 0.60 s)."""
PACE = 1.1
"""Factor on the peak speeds that brings the percentiles to `TARGET`: people's reaches overlap, these follow one another."""
SECONDS = (0.13, 2.5)
"""Shortest and longest reach [s]."""
MIN_JERK_PEAK = 1.875
"""Peak speed of a min-jerk reach, in displacements a duration."""
REST = (0.12, 0.6)
"""Share of time in rests of their own, and their mean length [s]; slow ends of reaches and a hand that waits for the other add to
it."""
TOGETHER, APART = 0.4, 0.4
"""Share of reaches with both hands in phase, and independent; in the rest one hand keeps still."""
BOX = ((0.12, 0.5), (-0.05, 0.6), (-0.15, 0.6))
"""Where the left wrist goes: x, y, z in the pelvis frame [m]; the right one in its mirror."""
REACH = 0.52
"""Farthest goal from the shoulder [m]."""
SHOULDER = np.array([0.0, 0.21, 0.43])
"""Left shoulder in the pelvis frame [m]."""
HASTE, STEPS = 0.6, 2
"""In teleoperation joints turn at no more than this share of their motors' speed, and one step of inverse kinematics a tick follows
hands of up to 2.3 m/s; here, as with people, motors turn as fast as they can, and this many steps follow."""
TURN = (0.5, 0.3, 0.5)
"""Deviation of the hands' goal orientation about x, y, z [rad]."""
WALKING = 0.33
"""Share of clips with arm swing."""
CLIP_SECONDS = 15.0
VALIDATION_SHARE = 10
"""One clip in so many is for validation."""
CUTOFF = 10.0
"""Low-pass of the joint targets [Hz]."""


@dataclass(frozen=True)
class SyntheticConfig:
    """Make up clips of teleoperation for the robot's waist and arms.

    Example: teleop-train synthetic --minutes 20 --out runs/synthetic.npz
    """

    out: Path = Path("runs/synthetic.npz")
    """File to write."""
    minutes: float = 20.0
    """Length of all clips together."""
    seed: int = 0
    """The same seed makes the same clips."""
    robot: str = "h1"
    """Robot that moves."""


def synthesize(config: SyntheticConfig) -> ClipSet:
    """Make clips, write them, print the wrist speeds beside people's.

    Raises:
        UnknownRobot: no such robot.
    """
    console = Console()
    robot = catalog.load(config.robot)
    count = max(round(60 * config.minutes / CLIP_SECONDS), 1)
    seeds = np.random.default_rng(config.seed).integers(0, 2**32, count)
    generator = Generator(robot)
    clips = [generator.clip(i, int(seed)) for i, seed in enumerate(track(seeds, "moving hands", console=console))]
    made = ClipSet.of(robot.spec, clips, "synthetic teleoperation, made by this project")
    made.save(config.out)
    speeds = np.concatenate([generator.wrist_speeds(clip) for clip in clips])
    for percentile, wanted in TARGET.items():
        found = float(np.percentile(speeds, percentile))
        verdict = "ok" if abs(found / wanted - 1) <= TOLERANCE else f"[yellow]off by more than {TOLERANCE:.0%}[/]"
        console.print(f"wrist speed p{percentile}: {found:.2f} m/s, people {wanted:.2f} m/s: {verdict}", highlight=False)
    console.print(f"{len(made)} clips, {made.seconds / 60:.1f} minutes -> {config.out}")
    return made


class Generator:
    """Makes synthetic clips of one robot."""

    def __init__(self, robot: Robot) -> None:
        self._spec, self._dt = robot.spec, 1 / robot.spec.policy_rate
        self._reach = Reach(robot, self._dt / (STEPS * HASTE))

    def clip(self, number: int, seed: int) -> Clip:
        """One clip of `CLIP_SECONDS`."""
        rng = np.random.default_rng(seed)
        spec, steps = self._spec, round(CLIP_SECONDS / self._dt)
        home = spec.home[spec.group("waist", "arms")]
        self._reach.reset(home)
        hands = Hands(self._reach.forward(home), rng)
        swing = Swing(rng)
        q = np.empty((steps, len(home)))
        for t in range(steps):
            wrists = hands.step(self._dt)
            wrists[:, :3] += swing.at(t * self._dt)
            for _ in range(STEPS):
                q[t] = self._reach.solve(wrists).q
        q = np.clip(low_pass(q, spec.policy_rate, CUTOFF), *(limit[spec.group("waist", "arms")] for limit in (spec.lower, spec.upper)))
        twist = np.tile(swing.twist, (steps, 1))
        height = np.full(steps, spec.nominal_height)
        split = "val" if number % VALIDATION_SHARE == VALIDATION_SHARE - 1 else "train"
        return Clip(f"synthetic_{number:04d}", spec.policy_rate, q, twist, height, "synthetic", split, "synthetic")

    def wrist_speeds(self, clip: Clip) -> np.ndarray:
        """Speeds of both wrists in the chest frame [2 (T - 1)], m/s."""
        q = clip.q.copy()
        q[:, 0] = 0.0  # the waist at rest makes the pelvis frame the chest's
        places = np.array([self._reach.forward(row)[:, :3] for row in q])
        return np.linalg.norm(np.diff(places, axis=0), axis=-1).ravel() / self._dt


class Swing:
    """Fore and aft swing of both arms in step with a walk, and the walk; nothing in clips of standing."""

    def __init__(self, rng: np.random.Generator) -> None:
        walking = rng.random() < WALKING
        speed = rng.uniform(0.3, 1.2) * walking
        self.twist = np.array([speed, 0.0, rng.normal(0, 0.2) * walking])
        """Base velocity and yaw rate that go with it [3]."""
        self._amplitude = rng.uniform(0.05, 0.12) * speed
        self._rate, self._phase = 2 * np.pi * rng.uniform(0.7, 1.0), rng.uniform(0, 2 * np.pi)

    def at(self, time: float) -> np.ndarray:
        """Displacement of the left and right wrist [2, 3], m."""
        forward = self._amplitude * np.sin(self._rate * time + self._phase)
        return np.array([[forward, 0, 0], [-forward, 0, 0]])


class Hands:
    """Targets of both wrists: reaches and rests, drawn anew as each ends."""

    def __init__(self, wrists: np.ndarray, rng: np.random.Generator) -> None:
        self._rng = rng
        self._ways = [Way(wrists[side]) for side in range(2)]
        self._coupled = False

    def step(self, dt: float) -> np.ndarray:
        """Wrist poses one tick later, position [m] and quaternion wxyz [2, 7]."""
        left, right = self._ways
        if left.over and right.over:
            self._begin()
        elif not self._coupled:
            for side, way in enumerate(self._ways):
                if way.over:
                    self._single(side)
        return np.stack([way.step(dt) for way in self._ways])

    def _begin(self) -> None:
        """Both hands are free: choose how they go on."""
        draw = self._rng.random()
        self._coupled = draw < TOGETHER or draw >= TOGETHER + APART
        if draw < TOGETHER:
            self._pair()
        elif draw < TOGETHER + APART:
            for side in range(2):
                self._single(side)
        else:
            moving = int(self._rng.integers(2))
            self._single(moving)
            self._ways[1 - moving].rest(self._ways[moving].length)

    def _single(self, side: int) -> None:
        way = self._ways[side]
        if self._rests():
            way.rest(self._rng.exponential(REST[1]))
            return
        place, turn, seconds = self._goal(side)
        way.go(place, turn, seconds)

    def _pair(self) -> None:
        """Both hands reach in one phase: mirrored, or side by side as with a box."""
        if self._rests():
            length = self._rng.exponential(REST[1])
            for way in self._ways:
                way.rest(length)
            return
        lead = int(self._rng.integers(2))
        place, turn, seconds = self._goal(lead)
        self._ways[lead].go(place, turn, seconds)
        shift = place - self._ways[lead].start
        if self._rng.random() < 0.5:
            shift = shift * np.array([1, -1, 1])
        place = _inside(1 - lead, self._ways[1 - lead].start + shift)
        self._ways[1 - lead].go(place, self._turn(), seconds)

    def _rests(self) -> bool:
        """Whether a rest comes next, so that rests take up their share of time (a reach lasts 0.35 s on average)."""
        share, length = REST
        odds = share / (1 - share) * 0.35 / length
        return self._rng.random() < odds / (1 + odds)

    def _goal(self, side: int) -> tuple[np.ndarray, Rotation, float]:
        """A place in which the hand can be, how it is turned there, and how many seconds it takes to get there."""
        one, other = self._rng.standard_normal(2)
        also = TOGETHERNESS * one + np.sqrt(1 - TOGETHERNESS**2) * other
        length = min(DISPLACEMENT[0] * np.exp(DISPLACEMENT[1] * one), DISPLACEMENT[2])
        peak = min(PACE * PEAK_SPEED[0] * np.exp(PEAK_SPEED[1] * also), PEAK_SPEED[2])
        start = self._ways[side].place
        tries = start + length * _directions(self._rng, 24)
        places = np.array([_inside(side, place) for place in tries])
        place = places[np.linalg.norm(places - tries, axis=1).argmin()]
        seconds = float(np.clip(MIN_JERK_PEAK * np.linalg.norm(place - start) / peak, *SECONDS))
        return place, self._turn(), seconds

    def _turn(self) -> Rotation:
        return Rotation.from_euler("xyz", self._rng.standard_normal(3) * TURN)


class Way:
    """One hand on its way between two poses."""

    def __init__(self, pose: np.ndarray) -> None:
        self.start = self.place = pose[:3].copy()
        self._end = self.place
        self._from = self._to = Rotation.from_quat(pose[[4, 5, 6, 3]])
        self.length, self._age = 0.0, 0.0

    @property
    def over(self) -> bool:
        return self._age >= self.length

    def rest(self, seconds: float) -> None:
        """Stay for a while."""
        self.go(self._end, self._to, seconds)

    def go(self, place: np.ndarray, turn: Rotation, seconds: float) -> None:
        """Set out for a pose, to arrive after `seconds`."""
        self.start, self._end, self._from, self._to = self._end, place, self._to, turn
        self.length, self._age = seconds, 0.0

    def step(self, dt: float) -> np.ndarray:
        """The pose one tick later [7]."""
        self._age += dt
        s = min(self._age / max(self.length, dt), 1.0)
        s = s**3 * (10 - 15 * s + 6 * s * s)
        self.place = self.start + s * (self._end - self.start)
        turn = self._from * Rotation.from_rotvec(s * (self._from.inv() * self._to).as_rotvec())
        return np.concatenate([self.place, np.roll(turn.as_quat(), 1)])


def _directions(rng: np.random.Generator, count: int) -> np.ndarray:
    v = rng.standard_normal((count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def _inside(side: int, place: np.ndarray) -> np.ndarray:
    """The nearest place in the box and within the arm's reach."""
    flip = np.array([1, 1 - 2 * side, 1])
    low, high = np.array(BOX).T
    place = np.clip(place * flip, low, high)
    away = place - SHOULDER
    distance = np.linalg.norm(away)
    return (SHOULDER + away * min(1.0, REACH / distance)) * flip
