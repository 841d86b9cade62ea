"""Reads a BVH file (plain or .gz) into joint positions and orientations in a z-up world. Parser: pybvh."""

from __future__ import annotations

import gzip
import tempfile
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pybvh

from policies.motion.errors import UnreadableMotion

_Y_UP = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
"""Turns a world with y up into ours with z up."""


@dataclass(frozen=True)
class Bvh:
    """A skeleton in motion. J joints in file order, T frames."""

    names: tuple[str, ...]
    """Joint names, root first [J]."""
    parents: tuple[int, ...]
    """Index of each joint's parent; -1 for the root [J]."""
    offsets: np.ndarray
    """Joint origin in its parent's frame, file units [J, 3]."""
    tips: np.ndarray
    """Where a joint's bone ends if nothing hangs from it (its end site), in its own frame; else 0 [J, 3]."""
    rotations: np.ndarray
    """World orientation of each joint [T, J, 3, 3]; the world is z-up, a joint's own axes are the file's."""
    positions: np.ndarray
    """World position of each joint, file units [T, J, 3]."""
    rate: float
    """Frames a second."""


def read(path: Path) -> Bvh:
    """The motion in a .bvh or .bvh.gz file.

    Raises:
        UnreadableMotion: the file is no BVH, is cut off or damaged, or holds numbers that are not finite.
    """
    try:
        parsed = _parse(path)
    except (OSError, EOFError, zlib.error, UnicodeDecodeError, ValueError, IndexError, KeyError) as error:
        raise UnreadableMotion(path, f"not a readable BVH file ({error})") from error
    if not (np.isfinite(parsed.root_pos).all() and np.isfinite(parsed.joint_angles).all()):
        raise UnreadableMotion(path, "holds numbers that are not finite")
    positions = parsed.joint_positions()
    upright = _upright(positions)
    joints = [node for node in parsed.nodes if not node.is_end_site()]
    index = {id(node): i for i, node in enumerate(joints)}
    parents = tuple(index[id(node.parent)] if node.parent is not None else -1 for node in joints)
    tips = np.zeros((len(joints), 3))
    for node in parsed.nodes:
        if node.is_end_site():
            tips[index[id(node.parent)]] = node.offset
    _, local = parsed.to_rotmat()
    return Bvh(
        names=tuple(node.name for node in joints),
        parents=parents,
        offsets=np.array([node.offset for node in joints], dtype=float),
        tips=tips,
        rotations=_accumulate(upright @ local[:, 0], local, parents),
        positions=positions @ upright.T,
        rate=1.0 / parsed.frame_time,
    )


def _parse(path: Path) -> pybvh.Bvh:
    if path.suffix != ".gz":
        return pybvh.read_bvh_file(path, world_up="+y")
    with tempfile.TemporaryDirectory() as folder:  # pybvh reads files by name only
        plain = Path(folder) / path.stem
        plain.write_bytes(gzip.decompress(path.read_bytes()))
        return pybvh.read_bvh_file(plain, world_up="+y")


def _upright(positions: np.ndarray) -> np.ndarray:
    """BVH files are y-up by custom, a few are z-up: the person is tallest along the vertical, on average."""
    extent = np.ptp(positions, axis=1).mean(0)
    return np.eye(3) if extent[2] > extent[1] else _Y_UP


def _accumulate(root: np.ndarray, local: np.ndarray, parents: tuple[int, ...]) -> np.ndarray:
    world = np.empty_like(local)
    world[:, 0] = root
    for i, parent in enumerate(parents[1:], start=1):
        world[:, i] = world[:, parent] @ local[:, i]
    return world
