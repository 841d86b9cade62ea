"""Recorded episodes as named arrays, read one at a time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np

from app.exports.anatomy import Anatomy, anatomy
from app.exports.errors import ExportError, NothingChosen
from policies.episode import EpisodeInfo, Metadata
from policies.recording.library import Library
from policies.recording.model import load_model
from policies.recording.reader import Recording


@dataclass(frozen=True)
class Demonstration:
    """One episode; n rows, of which each holds what was sensed before a tick and what was done in it."""

    index: int
    """Counts the episodes of the export from 0."""
    info: EpisodeInfo
    metadata: Metadata
    signals: Mapping[str, np.ndarray]
    """position, velocity [n, nu] (motors), base [n, 13], target [n, nu] (what the motors were aimed at), command [n, 36] (as
    applied), received [n, 36], tick, time, wall, mode, reason, jump, reward, done [n],
    qpos [n, nq], pelvis [n, 7] (its pose), state [n, nstate]."""

    def __len__(self) -> int:
        return len(self.signals["tick"])

    @property
    def task(self) -> str:
        """What was to be done, in words."""
        return self.info.label or "teleoperate"


@dataclass(frozen=True)
class Choice:
    """Which episodes to export; an empty field asks for nothing."""

    ids: tuple[str, ...] = ()
    """Ids, or their last number alone ("3" is ..._003)."""
    labels: tuple[str, ...] = ()
    """Task texts."""
    success: bool | None = None
    """Only those that were marked so."""

    def takes(self, info: EpisodeInfo) -> bool:
        """Whether the episode is asked for."""
        known = {info.id, str(info.number)}
        return (
            info.ended != "open"
            and info.rows > 0
            and (not self.ids or not known.isdisjoint(self.ids))
            and (not self.labels or info.label in self.labels)
            and (self.success is None or info.success is self.success)
        )


class Demonstrations:
    """The chosen episodes of some files, oldest first. Iterate as often as needed; one episode is in memory at a time."""

    def __init__(self, paths: Sequence[Path], choice: Choice, fps: int | None = None) -> None:
        """Look the episodes up.

        Args:
            paths: recordings, or folders of them.
            choice: which episodes.
            fps: rows a second to keep; all when None.

        Raises:
            ExportError: nothing fits, the rows cannot be thinned to `fps`, or the files hold different robots.
            DamagedRecording, CannotReplay, OSError: a file cannot be read, or its model cannot.
        """
        infos = [info for path in paths for info in _infos(path)]
        self.infos = sorted((info for info in infos if choice.takes(info)), key=lambda info: (info.start, info.id))
        if not self.infos:
            raise NothingChosen(paths, (f"{info.id} {info.label!r}" for info in infos if info.rows))
        with Recording(self.infos[0].file) as first:
            self.model = load_model(first)
            self.anatomy = anatomy(first.metadata.robot, self.model)
            rate = round(first.metadata.rate)
        self.fps = fps or rate
        if self.fps > rate or rate % self.fps:
            allowed = ", ".join(str(rate // every) for every in range(1, rate + 1) if rate % every == 0)
            raise ExportError(f"{rate} rows a second were recorded, {self.fps} a second cannot be taken evenly; --fps can be {allowed}")
        self._every = rate // self.fps

    def __len__(self) -> int:
        return len(self.infos)

    def __iter__(self) -> Iterator[Demonstration]:
        for index, info in enumerate(self.infos):
            with Recording(info.file) as recording:
                yield self._read(index, info, recording)

    @cached_property
    def tasks(self) -> tuple[str, ...]:
        """Every task text once, in order of appearance."""
        return tuple(dict.fromkeys(info.label or "teleoperate" for info in self.infos))

    @property
    def rows(self) -> int:
        """How many rows will be exported, as far as the files tell."""
        return sum(-(-info.rows // self._every) for info in self.infos)

    def _read(self, index: int, info: EpisodeInfo, recording: Recording) -> Demonstration:
        metadata, names = recording.metadata, self.anatomy
        fits = (metadata.robot, metadata.nq, metadata.dtype["ctrl"].shape) == (names.robot, self.model.nq, (len(names.motors),))
        if not fits:
            raise ExportError(f"{info.file} holds another robot than {self.infos[0].file}; export them one by one")
        rows = recording.episode(info).rows[:: self._every]
        if not len(rows):
            raise ExportError(f"no row of episode {info.id} can be read; choose the others with --episode")
        return Demonstration(index, info, metadata, _signals(rows, metadata, names, info.success))


def _infos(path: Path) -> list[EpisodeInfo]:
    files = Library(path).files() if path.is_dir() else [path]
    found = []
    for file in files:
        with Recording(file) as recording:
            found += recording.infos
    return found


def _signals(rows: np.ndarray, metadata: Metadata, names: Anatomy, success: bool | None) -> dict[str, np.ndarray]:
    qpos = metadata.qpos(rows)
    qvel = rows["state"][:, 1 + metadata.nq :][:, : metadata.nv]
    reward, done = np.zeros(len(rows)), np.zeros(len(rows), bool)
    done[-1:], reward[-1:] = True, float(success is True)
    return {
        "position": qpos[:, names.qpos],
        "velocity": qvel[:, names.qvel],
        "base": np.concatenate([qpos[:, :7], qvel[:, :6]], axis=1),
        "target": rows["ctrl"],
        "command": rows["applied"],
        "received": rows["raw"],
        **{name: rows[name] for name in ("tick", "time", "wall", "mode", "reason", "jump", "state")},
        "reward": reward,
        "done": done,
        "qpos": qpos,
        "pelvis": qpos[:, :7],
    }


def kinematics(model: mujoco.MjModel, data: mujoco.MjData, qpos: np.ndarray) -> None:
    """Put every body where it is at `qpos` [nq]."""
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
