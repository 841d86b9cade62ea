"""Turns a BVH skeleton in motion into a `Person`, from joint positions and the bones' own orientations.

Files differ in where a bone's axes point, so nothing is taken from them but geometry: the chest's axes come from shoulders and
trunk, the upper arm's twist from the side to which the forearm bends. Where the arm is straight that side is not visible; there
the bone's own orientation carries it, calibrated by the frames in which it is (`elbow_side`), pooled over all files of a skeleton.
"""

from __future__ import annotations

import numpy as np

from policies.motion.bvh import Bvh
from policies.motion.person import Person, frame, rotation, unit
from policies.motion.skeleton import Parts, find

STRAIGHT, BENT = 0.15, 0.45
"""Sine of the elbow angle below which the arm counts as straight, and above which its bend alone gives the twist."""


def elbow_side(motion: Bvh) -> np.ndarray:
    """Which way the forearms bend, in the upper arms' own axes, not normalised [2, 3]: sums over frames, for pooling.

    Weighed by the cube of the elbow angle's sine, so that bent frames decide and straight, noisy ones do not count.
    """
    parts = find(motion)
    total = np.zeros((2, 3))
    for side in range(2):
        _, bend = _bend(motion, parts, side)
        weight = np.linalg.norm(bend, axis=-1, keepdims=True) ** 2
        total[side] = (weight * _local(motion.rotations[:, parts.upper_arm[side]], bend)).sum(0)
    return total


def observe(motion: Bvh, side_of_bend: np.ndarray) -> Person:
    """The person in a skeleton.

    Args:
        motion: the skeleton.
        side_of_bend: `elbow_side` of this motion, or its sum over motions of the same skeleton [2, 3].

    Raises:
        MissingJoints: arms or legs were not found by name.
    """
    parts = find(motion)
    chest, waist = _trunk(motion, parts)
    arms = [_arm(motion, parts, side, unit(side_of_bend[side])) for side in range(2)]
    upper = np.stack([arm[0] for arm in arms], axis=1)
    flexion = np.stack([arm[1] for arm in arms], axis=1)
    hand = np.stack([arm[2] for arm in arms], axis=1)
    reach = np.stack([arm[3] for arm in arms], axis=1)
    leg, pelvis, standing = _legs(motion, parts)
    across = _between(motion.positions, parts.thigh)
    return Person(
        rate=motion.rate,
        waist=waist,
        upper_arm=np.swapaxes(chest, -1, -2)[:, None] @ upper,
        flexion=flexion,
        hand=hand,
        pelvis=pelvis / leg,
        heading=np.unwrap(np.arctan2(-across[:, 0], across[:, 1])),
        standing=standing / leg,
        wrist=_local(chest[:, None], reach),
    )


def _local(frames: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.einsum("...ji,...j->...i", frames, vectors)


def _between(positions: np.ndarray, pair: tuple[int, int]) -> np.ndarray:
    """From the right to the left joint of a pair [T, 3]."""
    return positions[:, pair[0]] - positions[:, pair[1]]


def _trunk(motion: Bvh, parts: Parts) -> tuple[np.ndarray, np.ndarray]:
    """World orientation of the chest frame [T, 3, 3] and its turn against the pelvis [T]."""
    axes, positions = motion.rotations[:, parts.chest], motion.positions
    along = positions[:, list(parts.upper_arm)].mean(1) - positions[:, list(parts.thigh)].mean(1)
    up = unit(_local(axes, unit(along)).mean(0))
    left = _collars(motion, parts)
    if left is None:
        left = _local(axes, _between(positions, parts.upper_arm)).mean(0)
    chest = axes @ frame(np.cross(left, up), up)
    hips = _local(chest, _between(positions, parts.thigh))  # the pelvis's left, seen from the chest
    return chest, np.arctan2(hips[:, 0], hips[:, 1])


def _collars(motion: Bvh, parts: Parts) -> np.ndarray | None:
    """From the right to the left collar-bone's root in the chest's own axes [3]; None where both start at one point."""
    roots = []
    for joint in parts.upper_arm:
        while motion.parents[joint] != parts.chest:
            joint = motion.parents[joint]
        roots.append(motion.offsets[joint])
    across = roots[0] - roots[1]
    width = np.linalg.norm(_between(motion.positions, parts.upper_arm), axis=-1).mean()
    return across if np.linalg.norm(across) > 0.1 * width else None


def _bend(motion: Bvh, parts: Parts, side: int) -> tuple[np.ndarray, np.ndarray]:
    """Upper arm's direction [T, 3] and the part of the forearm's direction across it [T, 3] (its length is the elbow's sine)."""
    shoulder, elbow, wrist = (motion.positions[:, joint[side]] for joint in (parts.upper_arm, parts.forearm, parts.hand))
    along, forearm = unit(elbow - shoulder), unit(wrist - elbow)
    return along, forearm - (forearm * along).sum(-1, keepdims=True) * along


def _arm(motion: Bvh, parts: Parts, side: int, side_of_bend: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """World orientation of the upper arm [T, 3, 3], elbow angle [T], hand in the forearm [T, 3, 3], reach in arm lengths [T, 3]."""
    shoulder, elbow, wrist = (motion.positions[:, joint[side]] for joint in (parts.upper_arm, parts.forearm, parts.hand))
    along, bend = _bend(motion, parts, side)
    sine = np.linalg.norm(bend, axis=-1, keepdims=True)
    trust = np.clip((sine - STRAIGHT) / (BENT - STRAIGHT), 0, 1)
    carried = motion.rotations[:, parts.upper_arm[side]] @ side_of_bend
    upper = frame(trust * unit(bend) + (1 - trust) * carried, -along)
    forearm = unit(wrist - elbow)
    flexion = np.arctan2((forearm * upper[..., 0]).sum(-1), (forearm * along).sum(-1))
    lower = upper @ rotation(1, np.pi / 2 - flexion)
    hand = motion.rotations[:, parts.hand[side]] @ _palm(motion, parts, side, side_of_bend)
    length = np.linalg.norm(elbow - shoulder, axis=-1).mean() + np.linalg.norm(wrist - elbow, axis=-1).mean()
    return upper, flexion, np.swapaxes(lower, -1, -2) @ hand, (wrist - shoulder) / length


def _palm(motion: Bvh, parts: Parts, side: int, side_of_bend: np.ndarray) -> np.ndarray:
    """The hand frame in the hand joint's own axes [3, 3].

    In the file's zero pose the hand continues the forearm. Its thumb is where the file's thumb joint is; without one it is taken
    to point where the elbow bends.
    """
    joint, forearm = parts.hand[side], np.zeros(3)
    while joint != parts.forearm[side]:
        forearm = forearm + motion.offsets[joint]
        joint = motion.parents[joint]
    thumb = side_of_bend
    if parts.thumb is not None:
        offset = motion.offsets[parts.thumb[side]] + motion.tips[parts.thumb[side]]
        thumb = offset if np.linalg.norm(offset) > 1e-6 * np.linalg.norm(forearm) else thumb
    x = unit(forearm)
    return frame(x, thumb - (thumb @ x) * x)


def _legs(motion: Bvh, parts: Parts) -> tuple[float, np.ndarray, float]:
    """Leg length, mid-hip position above the floor [T, 3] and its height when standing straight, in file units."""
    thigh, shin, foot = (motion.positions[:, list(pair)] for pair in (parts.thigh, parts.shin, parts.foot))
    leg = float(np.linalg.norm(shin - thigh, axis=-1).mean() + np.linalg.norm(foot - shin, axis=-1).mean())
    floor = motion.positions[..., 2].min()
    ankle = np.percentile(foot[..., 2] - floor, 5)
    hips = thigh.mean(1)
    hips[:, 2] -= floor
    return leg, hips, leg + float(ankle)
