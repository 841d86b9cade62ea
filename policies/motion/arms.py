"""Closed-form joint angles of waist and arms for a `Person`, for robots with a tilted shoulder-pitch axis (H1, G1, H1-2).

Per arm, with t the tilt of the shoulder's mounting about x: R_torso_upperarm = Rx(t) Ry(pitch) Rx(roll - t) Rz(yaw), elbow pitch =
pi/2 - flexion (0 is the forearm forward), and the hand in the forearm = Rx(elbow roll) Ry(wrist pitch) Rz(wrist yaw).
Angles map whole rotations (ExBody reads exponential maps as serial joint angles, which is wrong beyond small angles).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from policies.motion.person import Person, rotation
from robots.spec import RobotSpec

ORDER = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow_pitch", "elbow_roll", "wrist_pitch", "wrist_yaw")
"""An arm's joints, in motor order."""


@dataclass(frozen=True)
class Arms:
    """The numbers of a robot's waist and arms that retargeting needs; joints as in `ORDER`, sides (left, right)."""

    tilt: tuple[float, float]
    """Mounting tilt of the shoulder-pitch axis about the torso's x [rad]."""
    lower: np.ndarray
    """Lower limits: waist, left arm, right arm [15], rad."""
    upper: np.ndarray
    """Upper limits [15], rad."""
    speed: np.ndarray
    """Joint speed limits [15], rad/s."""

    @staticmethod
    def of(spec: RobotSpec) -> Arms:
        """The arms of a robot of the catalog; its joints must be those of `ORDER`."""
        part = spec.group("waist", "arms")
        names = [name.removesuffix("_joint").split("_", 1)[1] for name in spec.motor_names[part][1:]]
        if tuple(names) != ORDER * 2:
            raise ValueError(f"{spec.name}'s arms are not two chains of {', '.join(ORDER)}")
        quaternion = {body.name: body.quat for body in spec.bodies}
        left, right = (quaternion[f"{side}_shoulder_pitch_link"] for side in ("left", "right"))
        tilt = (2 * np.arctan2(left[1], left[0]), 2 * np.arctan2(right[1], right[0]))
        return Arms(tilt, spec.lower[part], spec.upper[part], spec.velocity[part])

    def upper_arm(self, q: np.ndarray) -> np.ndarray:
        """Orientation of the upper arms in the torso [..., 2, 3, 3] at waist and arm angles q [..., 15]."""
        q = q[..., 1:].reshape(*q.shape[:-1], 2, 7)
        tilt = np.array(self.tilt)
        turned = rotation(0, tilt) @ rotation(1, q[..., 0])
        return turned @ rotation(0, q[..., 1] - tilt) @ rotation(2, q[..., 2])

    def solve(self, person: Person) -> np.ndarray:
        """Angles of waist and arms [T, 15], not yet held to the limits."""
        q = np.empty((person.frames, 15))
        q[:, 0] = person.waist
        for side in range(2):
            part = slice(1 + 7 * side, 8 + 7 * side)
            q[:, part] = self._arm(person, side, self.lower[part], self.upper[part])
        return q

    def _arm(self, person: Person, side: int, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
        roll_at = self.tilt[side]
        shoulder = _nearest_branch(_shoulder(person.upper_arm[:, side], roll_at), lower[:3], upper[:3])
        elbow = np.pi / 2 - person.flexion[:, side]
        hand = person.hand[:, side]
        wrist = np.stack(
            [
                np.arctan2(-hand[:, 1, 2], hand[:, 2, 2]),
                np.arcsin(np.clip(hand[:, 0, 2], -1, 1)),
                np.arctan2(-hand[:, 0, 1], hand[:, 0, 0]),
            ],
            axis=-1,
        )
        return np.concatenate([shoulder, elbow[:, None], wrist], axis=-1)


def _shoulder(upper_arm: np.ndarray, tilt: float) -> np.ndarray:
    """Both solutions (pitch, roll, yaw) [2, T, 3] of Ry(pitch) Rx(roll - tilt) Rz(yaw) = Rx(-tilt) upper_arm."""
    r = rotation(0, np.array(-tilt)) @ upper_arm
    roll = np.arcsin(np.clip(-r[:, 1, 2], -1, 1))
    one = np.stack([np.arctan2(r[:, 0, 2], r[:, 2, 2]), roll + tilt, np.arctan2(r[:, 1, 0], r[:, 1, 1])], axis=-1)
    other = np.stack([one[:, 0] + np.pi, np.pi - roll + tilt, one[:, 2] + np.pi], axis=-1)
    return np.stack([one, other])


def _nearest_branch(branches: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """One solution a frame [T, 3] out of [B, T, 3]: the path that leaves the limits least and jumps least (dynamic programming)."""
    middle = (lower + upper) / 2
    turned = middle + np.mod(branches - middle + np.pi, 2 * np.pi) - np.pi
    outside = np.maximum(np.maximum(lower - turned, turned - upper), 0).sum(-1)
    jump = np.abs(turned[:, None, 1:] - turned[None, :, :-1]).sum(-1)  # [to, from, T - 1]
    cost, came = outside[:, 0], []
    for t in range(1, turned.shape[1]):
        step = cost[None, :] + jump[:, :, t - 1]
        came.append(step.argmin(1))
        cost = step.min(1) + outside[:, t]
    at = [int(cost.argmin())]
    for back in reversed(came):
        at.append(int(back[at[-1]]))
    return turned[np.array(at[::-1]), np.arange(turned.shape[1])]
