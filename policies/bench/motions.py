"""Which motions a bench plays: a user's own, retargeted ones, or made-up ones when there are none."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from policies.motion.clip import ClipSet, UnusableClips
from policies.motion.folder import RetargetConfig, retarget
from policies.motion.synthetic import CLIP_SECONDS, Generator
from robots.catalog import Robot

SYNTHETIC = 24
"""Clips made up when no motions are given."""


def motions(robot: Robot, path: Path | None) -> ClipSet:
    """The validation clips of a file of `teleop-train retarget`, all motions of a folder of BVH or G1 files, or synthetic ones.

    Raises:
        UnusableClips: the file is none of clips, or holds no validation clip.
        NoMotion: the folder holds no motion that can be used.
    """
    if path is None:
        seeds = np.random.default_rng(7).integers(0, 2**32, SYNTHETIC)
        generator = Generator(robot)
        return ClipSet.of(robot.spec, [generator.clip(i, int(seed)) for i, seed in enumerate(seeds)], f"synthetic, {CLIP_SECONDS} s each")
    if path.is_dir():
        with TemporaryDirectory() as aside:
            return retarget(RetargetConfig(path, Path(aside) / "clips.npz", robot.spec.name)).grounded()
    found = ClipSet.load(path, robot.spec).split("val").grounded()
    if not len(found):
        raise UnusableClips(path, "no clip in it is for validation")
    return found
