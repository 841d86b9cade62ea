"""What counts as a pose: three metres and a unit quaternion."""

from __future__ import annotations

import math

import numpy as np

FARTHEST = 5.0
"""A target farther than this from the pelvis was not meant [m]."""
SLACK = 0.01
"""How far a quaternion's length may be from one."""


def wrist_poses(wrists: np.ndarray) -> tuple[list[float] | None, list[float] | None]:
    """The left and the right wrist of [2, 7] with unit quaternions (wxyz); None for one that is no pose. Never raises."""
    try:
        left, right = np.asarray(wrists, dtype=float).reshape(2, 7).tolist()
    except (TypeError, ValueError, OverflowError):
        return None, None
    return _pose(left), _pose(right)


def _pose(row: list[float]) -> list[float] | None:
    x, y, z, *quaternion = row
    length = math.hypot(*quaternion)
    near = abs(x) < FARTHEST and abs(y) < FARTHEST and abs(z) < FARTHEST  # false for a NaN
    return [x, y, z, *(part / length for part in quaternion)] if near and abs(length - 1) < SLACK else None
