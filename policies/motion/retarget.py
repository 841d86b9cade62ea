"""A person's motion becomes the robot's: waist and arm angles at the policy rate, within limits and joint speeds, and the base's way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from policies.motion.arms import Arms
from policies.motion.clear import Clear
from policies.motion.follow import Follower
from policies.motion.person import Person
from policies.motion.smooth import bound_speed, low_pass, resample
from robots.catalog import Robot
from robots.spec import RobotSpec

JUMP = 25.0
"""Joint speed of the closed form beyond which inverse kinematics takes over [rad/s]."""
CUTOFF = 6.0
"""Low-pass of the joint angles [Hz]."""
GAIT_CUTOFF = 0.5
"""Low-pass of the base's way [Hz]: sway and yaw within a stride vanish, where the person went remains."""
CLIPPED = 0.05
"""Angle beyond a limit that counts as clipped [rad]."""


@dataclass(frozen=True)
class Retargeted:
    """A clip's curves at the robot's policy rate, and what it took to make them."""

    q: np.ndarray
    """Waist and arms [T, 15], rad."""
    twist: np.ndarray
    """Base velocity and yaw rate in the heading frame [T, 3], m/s and rad/s."""
    height: np.ndarray
    """Pelvis height [T], m."""
    clipped: float
    """Share of the arm samples with a joint more than 0.05 rad beyond its limit, before it was held to it."""
    mended: float
    """Share of the frames that inverse kinematics made."""
    moved_clear: float
    """Share of the samples in which arms were moved out of the body."""
    wrist_error: float
    """Mean distance from the wrist that limits, speeds, the body and smoothing allow to the one the closed form asks for [m]."""
    human_error: float
    """Mean distance from the robot's wrist to the person's, both seen from the shoulder in the chest frame, the person's arm
    stretched to the robot's length [m]. Bones of other proportions make most of it: rotations are kept, not places."""


class Retargeter:
    """Turns persons into motions of one robot."""

    def __init__(self, robot: Robot) -> None:
        self._spec, self._arms, self._follower = robot.spec, Arms.of(robot.spec), Follower(robot)
        self._clear = Clear(robot)
        self._leg = _length(robot.spec, "knee_link", "ankle_pitch_link")
        self._bones = np.array(
            [_length(robot.spec, "shoulder_yaw_link", "elbow_pitch_link"), _length(robot.spec, "elbow_roll_link", "wrist_pitch_link")]
        )

    def __call__(self, person: Person) -> Retargeted:
        """The robot's version of a person's motion."""
        arms, rate, wanted = self._arms, person.rate, self._spec.policy_rate
        closed = arms.solve(person)
        held = np.clip(closed, arms.lower, arms.upper)
        speed = np.abs(np.diff(held, axis=0, prepend=held[:1])) * rate
        jumps = speed[:, 1:].reshape(-1, 2, 7).max(-1) > JUMP
        followed = self._follower.mend(closed, held, jumps, rate)
        smooth = np.clip(resample(low_pass(followed, rate, CUTOFF), rate, wanted), arms.lower, arms.upper)
        clear = self._clear(smooth, wanted)
        q = bound_speed(clear, arms.speed / wanted)
        twist, height = self._base(person)
        beyond = np.maximum(arms.lower - closed, closed - arms.upper)[:, 1:].reshape(-1, 2, 7)
        return Retargeted(
            q=q,
            twist=twist[: len(q)],
            height=height[: len(q)],
            clipped=float((beyond > CLIPPED).any(-1).mean()),
            moved_clear=float((clear != smooth).any(-1).mean()),
            mended=float((followed != held).any(-1).mean()),
            wrist_error=self._wrist_error(closed, q, rate),
            human_error=self._human_error(person, q),
        )

    def _base(self, person: Person) -> tuple[np.ndarray, np.ndarray]:
        """Twist [T, 3] and height [T] of the robot's base at the policy rate."""
        rate, wanted = person.rate, self._spec.policy_rate
        way = resample(low_pass(person.pelvis[:, :2] * self._leg, rate, GAIT_CUTOFF), rate, wanted)
        heading = resample(low_pass(person.heading, rate, GAIT_CUTOFF), rate, wanted)
        velocity = np.gradient(way, 1 / wanted, axis=0)
        c, s = np.cos(heading), np.sin(heading)
        forward, left = c * velocity[:, 0] + s * velocity[:, 1], c * velocity[:, 1] - s * velocity[:, 0]
        height = self._spec.nominal_height * resample(person.pelvis[:, 2], rate, wanted) / person.standing
        return np.stack([forward, left, np.gradient(heading, 1 / wanted)], axis=-1), height

    def _wrist_error(self, closed: np.ndarray, q: np.ndarray, rate: float) -> float:
        at = np.arange(0, len(q), 5)
        source = np.minimum(np.round(at * rate / self._spec.policy_rate).astype(int), len(closed) - 1)
        away = self._follower.wrists(q[at]) - self._follower.wrists(closed[source])
        return float(np.linalg.norm(away, axis=-1).mean())

    def _human_error(self, person: Person, q: np.ndarray) -> float:
        at = np.arange(0, len(q), 5)
        source = np.minimum(np.round(at * person.rate / self._spec.policy_rate).astype(int), person.frames - 1)
        upper = self._arms.upper_arm(q[at])
        elbow = q[at][:, [4, 11]]
        forearm = np.cos(elbow)[..., None] * upper[..., 0] - np.sin(elbow)[..., None] * upper[..., 2]
        wrist = -self._bones[0] * upper[..., 2] + self._bones[1] * forearm
        return float(np.linalg.norm(wrist - self._bones.sum() * person.wrist[source], axis=-1).mean())


def _length(spec: RobotSpec, *bodies: str) -> float:
    """Summed distance of the named left links from their parents [m]."""
    position = {body.name: body.pos for body in spec.bodies}
    return float(sum(np.linalg.norm(position[f"left_{name}"]) for name in bodies))
