"""One motion by what a person calls it: a clip of a store, or a file."""

from __future__ import annotations

from pathlib import Path

from policies.motion.clip import Clip, ClipSet
from policies.motion.errors import UnknownClip
from policies.motion.folder import retarget_file
from policies.motion.labels import kind
from robots.catalog import Robot

MIRRORED = "~mirror"


def find(name: str, store: Path, robot: Robot) -> Clip:
    """The motion file of that path, retargeted now, or else the store's clip of that name; NAME~mirror is its mirrored twin.

    Raises:
        UnreadableMotion: it is a file that cannot be retargeted.
        UnusableClips: it is no file, and the store is missing or damaged.
        UnknownClip: it is no file, and the store has no such clip.
    """
    path = Path(name)
    if kind(path) is not None and path.is_file():
        return retarget_file(path, robot)
    clips = {clip.name: clip for clip in ClipSet.load(store, robot.spec).clips}
    if name in clips:
        return clips[name]
    if (twin := name.removesuffix(MIRRORED)) in clips:
        return clips[twin].mirrored(robot.spec)
    raise UnknownClip(name, store, list(clips))
