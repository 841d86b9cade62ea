"""Clips: what waist and arms do, and where the base went, at the policy's rate; kept together in one .npz file."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from policies.motion.errors import MotionError
from robots.spec import RobotSpec

Split = Literal["train", "val"]
FORMAT = 1
RUNNING = 2.0
"""Median speed over the ground, at the robot's size, at which people run [m/s]."""
_LABELS = ("name", "subject", "category", "split")


class UnusableClips(MotionError):
    """A clip store that is damaged or was made for another robot."""

    def __init__(self, path: Path, reason: str) -> None:
        super().__init__(f"{path} cannot be used: {reason}; make it with `teleop-train retarget --clips FOLDER --out {path}`")


@dataclass(frozen=True)
class Clip:
    """One motion, T samples."""

    name: str
    rate: float
    """Samples a second: the robot's policy rate."""
    q: np.ndarray
    """Waist and arm targets in motor order [T, 15], rad; within the joint limits."""
    twist: np.ndarray
    """Forward and leftward velocity [m/s] and yaw rate [rad/s] of the base in its heading frame, smoothed [T, 3]."""
    height: np.ndarray
    """Pelvis height above the floor [T], m, at the robot's size."""
    subject: str
    """Who moved; splits are by subject."""
    split: Split
    category: str
    """walk, run, jump, gesture, manip, dance, fight, sport, synthetic, other."""

    @property
    def seconds(self) -> float:
        return len(self.q) / self.rate

    def mirrored(self, spec: RobotSpec) -> Clip:
        """The same motion seen in the sagittal mirror."""
        group = spec.group("waist", "arms")
        permutation, sign = spec.mirror
        q = self.q[:, permutation[group] - group.start] * sign[group].astype(self.q.dtype)
        return replace(self, name=f"{self.name}~mirror", q=q, twist=self.twist * np.array([1, -1, -1], self.twist.dtype))


@dataclass(frozen=True)
class ClipSet:
    """Clips of one robot."""

    robot: str
    joints: tuple[str, ...]
    """Names of the columns of every `q`."""
    clips: tuple[Clip, ...]
    about: str = ""
    """Where the motions come from and on what terms."""

    @staticmethod
    def of(spec: RobotSpec, clips: Iterable[Clip], about: str = "") -> ClipSet:
        return ClipSet(spec.name, spec.motor_names[spec.group("waist", "arms")], tuple(clips), about)

    def __len__(self) -> int:
        return len(self.clips)

    @property
    def seconds(self) -> float:
        return sum(clip.seconds for clip in self.clips)

    def where(self, wanted: Callable[[Clip], bool]) -> ClipSet:
        """The clips for which `wanted` holds."""
        return replace(self, clips=tuple(clip for clip in self.clips if wanted(clip)))

    def grounded(self) -> ClipSet:
        """Without running and jumping, which nobody does with a foot on the ground; ExBody leaves them out too. Who is faster than
        anybody walks runs, whatever the label says."""
        return self.where(lambda clip: clip.category not in ("run", "jump") and np.median(np.hypot(*clip.twist[:, :2].T)) < RUNNING)

    def split(self, split: Split) -> ClipSet:
        """The training or the validation clips."""
        return self.where(lambda clip: clip.split == split)

    def save(self, path: Path) -> None:
        """Write one compressed .npz; a crash leaves the old file or the new one."""
        path.parent.mkdir(parents=True, exist_ok=True)
        head = {"format": FORMAT, "robot": self.robot, "joints": self.joints, "about": self.about}
        columns = {label: np.array([getattr(clip, label) for clip in self.clips], dtype=np.str_) for label in _LABELS}
        arrays = {
            "head": np.array(json.dumps(head)),
            "length": np.array([len(clip.q) for clip in self.clips]),
            "rate": np.array([clip.rate for clip in self.clips]),
            "q": np.concatenate([clip.q for clip in self.clips] or [np.empty((0, len(self.joints)))]).astype(np.float32),
            "twist": np.concatenate([clip.twist for clip in self.clips] or [np.empty((0, 3))]).astype(np.float32),
            "height": np.concatenate([clip.height for clip in self.clips] or [np.empty(0)]).astype(np.float32),
        }
        aside = path.with_name(f".{path.name}")
        with aside.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **arrays, **columns)
        aside.replace(path)

    @staticmethod
    def load(path: Path, spec: RobotSpec) -> ClipSet:
        """The clips in a file that `save` wrote.

        Raises:
            UnusableClips: there is no such file, it is damaged, or its joints are not this robot's.
        """
        try:
            with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
                store = {name: stored[name] for name in stored.files}
            head = json.loads(str(store["head"]))
            ends = np.cumsum(store["length"])
            clips = tuple(_clip(store, i, slice(end - store["length"][i], end)) for i, end in enumerate(ends))
            found, version = ClipSet(head["robot"], tuple(head["joints"]), clips, head["about"]), head["format"]
        except (OSError, ValueError, KeyError, IndexError, TypeError, EOFError, zipfile.BadZipFile) as error:
            raise UnusableClips(path, str(error)) from error
        wanted = spec.motor_names[spec.group("waist", "arms")]
        if version != FORMAT or found.robot != spec.name or found.joints != wanted:
            raise UnusableClips(path, f"it holds motions of {found.robot!r} (format {version}), not of {spec.name!r}")
        return found


def _clip(store: dict[str, np.ndarray], i: int, rows: slice) -> Clip:
    labels = {label: str(store[label][i]) for label in _LABELS}
    q, twist, height = (store[name][rows] for name in ("q", "twist", "height"))
    return Clip(rate=float(store["rate"][i]), q=q, twist=twist, height=height, **labels)  # pyright: ignore[reportArgumentType]
