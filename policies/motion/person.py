"""What a person's upper body did, free of skeleton and size: the form between every reader and the robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Person:
    """T frames at one rate. Sides are (left, right).

    Chest frame: x forward, y left, z up along the trunk. Upper-arm frame: z from elbow to shoulder, x where the forearm goes
    when the elbow bends, so at zero rotation the arm hangs. Forearm frame: x to the wrist; z is the upper arm's x when the
    arm is straight. Hand frame: x along the fingers, z towards the thumb's side; it is the forearm frame when relaxed.
    """

    rate: float
    """Frames a second."""
    waist: np.ndarray
    """Turn of the chest against the pelvis about the trunk [T], rad, leftward positive."""
    upper_arm: np.ndarray
    """Orientation of the upper arms in the chest frame [T, 2, 3, 3]."""
    flexion: np.ndarray
    """Elbow angle, 0 when straight [T, 2], rad."""
    hand: np.ndarray
    """Orientation of the hands in the forearm frame [T, 2, 3, 3]."""
    pelvis: np.ndarray
    """Pelvis position in a z-up world [T, 3], in leg lengths (hip to ankle); z above the floor."""
    heading: np.ndarray
    """Yaw of the pelvis [T], rad, unwrapped."""
    standing: float
    """Height of the pelvis when standing straight, in leg lengths."""
    wrist: np.ndarray
    """From shoulder to wrist in the chest frame, in arm lengths (upper arm + forearm) [T, 2, 3]."""

    @property
    def frames(self) -> int:
        return len(self.waist)


def unit(v: np.ndarray) -> np.ndarray:
    """Vectors scaled to length 1 along the last axis; a vanishing vector stays near 0."""
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-9)


def frame(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Right-handed frames [..., 3, 3] whose z axis is `z` and whose x axis is nearest `x` (columns are axes)."""
    z = unit(z)
    y = unit(np.cross(z, x))
    return np.stack([np.cross(y, z), y, z], axis=-1)


def rotation(axis: int, angle: np.ndarray) -> np.ndarray:
    """Rotations [..., 3, 3] about a coordinate axis (0 x, 1 y, 2 z) by angles [...]."""
    angle = np.asarray(angle, dtype=float)
    c, s = np.cos(angle), np.sin(angle)
    out = np.zeros((*angle.shape, 3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out[..., axis, axis] = 1
    out[..., i, i], out[..., j, j] = c, c
    out[..., i, j], out[..., j, i] = -s, s
    return out
