"""Reads motions of a Unitree G1 (29 joints) as CSV rows: pelvis position, quaternion xyzw, then the joints in Unitree's order.

The G1's arms have the H1's joint sequence with another shoulder tilt, so its upper arms go through rotations and the rest maps
joint by joint. Its waist also rolls and pitches; the H1's does not, so arms are kept relative to the chest, as with people.
"""

from __future__ import annotations

import gzip
import io
import zlib
from pathlib import Path

import numpy as np

from policies.motion.arms import Arms
from policies.motion.errors import UnreadableMotion
from policies.motion.person import Person, rotation

RATE = 60.0
"""Rows a second; the files do not say it."""
COLUMNS = 36
WAIST, ARMS = 7 + 12, slice(7 + 15, 7 + 29)
"""Columns of the waist yaw joint and of both arms (left, right: shoulder pitch, roll, yaw, elbow, wrist roll, pitch, yaw)."""

TILT = 0.27931
"""Mounting tilt of the left shoulder [rad] (unitree_mujoco g1_29dof.xml: quaternion 0.990264 0.139201 0 0)."""
LEG, STANDING = 0.6, 0.79
"""Hip to ankle and pelvis height when standing straight [m] (the same file, rounded to its 0.3 + 0.3 and 0.793)."""
_UPPER_ARM, _FOREARM = 0.1963, 0.2
"""Shoulder to elbow and elbow to wrist [m], rounded from the same file; only directions reach the robot."""
_ARMS = Arms((TILT, -TILT), np.full(15, -np.pi), np.full(15, np.pi), np.full(15, np.inf))


def read(path: Path) -> Person:
    """What the upper body of a G1 did in a .csv or .csv.gz file.

    Raises:
        UnreadableMotion: the file is damaged, has not 36 columns of finite numbers, or its quaternions are not of length 1.
    """
    try:
        raw = gzip.decompress(path.read_bytes()) if path.suffix == ".gz" else path.read_bytes()
        rows = np.loadtxt(io.StringIO(raw.decode()), delimiter=",", ndmin=2)
    except (OSError, EOFError, zlib.error, UnicodeDecodeError, ValueError) as error:
        raise UnreadableMotion(path, f"not a readable CSV of numbers ({error})") from error
    if rows.shape[1] != COLUMNS or len(rows) < 2:
        raise UnreadableMotion(path, f"has {len(rows)} rows of {rows.shape[1]} columns; a G1 motion has {COLUMNS} columns")
    if not np.isfinite(rows).all() or np.abs(np.linalg.norm(rows[:, 3:7], axis=1) - 1).max() > 0.01:
        raise UnreadableMotion(path, "columns 4 to 7 are not unit quaternions (x, y, z, w), or a number is not finite")
    return _person(rows)


def _person(rows: np.ndarray) -> Person:
    x, y, z, w = rows[:, 3:7].T
    q = np.concatenate([rows[:, WAIST : WAIST + 1], rows[:, ARMS]], axis=1)
    arm = q[:, 1:].reshape(-1, 2, 7)
    upper = _ARMS.upper_arm(q)
    forearm = upper @ rotation(1, arm[..., 3])
    wrist = _UPPER_ARM * -upper[..., 2] + _FOREARM * forearm[..., 0]
    return Person(
        rate=RATE,
        waist=q[:, 0],
        upper_arm=upper,
        flexion=np.pi / 2 - arm[..., 3],
        hand=rotation(0, arm[..., 4]) @ rotation(1, arm[..., 5]) @ rotation(2, arm[..., 6]),
        pelvis=rows[:, 0:3] / LEG,
        heading=np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))),
        standing=STANDING / LEG,
        wrist=wrist / (_UPPER_ARM + _FOREARM),
    )
