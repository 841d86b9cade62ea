"""NVIDIA GR00T's flavour of LeRobot v2.1: one Parquet and one MP4 file an episode, and meta/modality.json, which names the pieces
of state and action.

Layout: NVIDIA/Isaac-GR00T, getting_started/data_preparation.md (Apache-2.0).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from app.exports import statistics, table, video
from app.exports.anatomy import BASE, COMMAND, COMMAND_PARTS
from app.exports.demonstration import Demonstration, Demonstrations
from app.exports.format import Frames
from app.exports.statistics import Statistics

VERSION = "v2.1"
FILES_A_CHUNK = 1000
DATA = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
VIDEO = "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4"
STATE, ACTION = ("position", "velocity", "base"), ("target", "command")
"""Signals that are put behind each other, in this order."""
BASE_PARTS = {"base_position": (0, 3), "base_quaternion": (3, 7), "base_velocity": (7, 10), "base_angular_velocity": (10, 13)}
TASK, VALID = "annotation.human.action.task_description", "annotation.human.validity"
COUNTERS = ("frame_index", "episode_index", "index", "task_index", TASK, VALID, "tick")


class Gr00t:
    """A folder that GR00T's data loader reads."""

    packages: ClassVar = ("pyarrow", "av")
    pictures: ClassVar = True
    fps: ClassVar = None
    tolerance: ClassVar = 0.0

    def __init__(self, path: Path, demonstrations: Demonstrations, cameras: tuple[str, ...], size: tuple[int, int]) -> None:
        self._path, self._all, self._names, self._size = path, demonstrations, cameras, size
        self._cameras = tuple(f"observation.images.{camera}" for camera in cameras)
        self._sizes = {"position": len(demonstrations.anatomy.motors), "velocity": len(demonstrations.anatomy.motors)}
        self._sizes |= {"base": len(BASE), "target": len(demonstrations.anatomy.motors), "command": len(COMMAND)}
        self._tasks = (*demonstrations.tasks, "valid", "invalid")
        self._episodes: list[dict[str, Any]] = []
        self._statistics: list[dict[str, Statistics]] = []
        self._rows = 0

    def add(self, demonstration: Demonstration, frames: Frames) -> None:
        """Rows and one video a camera."""
        columns = self._columns(demonstration)
        table.write_rows(self._path / DATA.format(**_place(demonstration.index)), columns)
        seen = self._film(demonstration.index, frames)
        self._statistics.append({name: statistics.of_values(values) for name, values in columns.items()} | seen)
        self._episodes.append({"episode_index": demonstration.index, "tasks": [demonstration.task], "length": len(demonstration)})
        self._rows += len(demonstration)

    def finish(self) -> None:
        """The folder meta/."""
        meta = self._path / "meta"
        table.write_lines(meta / "episodes.jsonl", self._episodes)
        table.write_lines(meta / "tasks.jsonl", ({"task_index": i, "task": task} for i, task in enumerate(self._tasks)))
        by_episode = ({name: table.plain(part) for name, part in found.items()} for found in self._statistics)
        table.write_lines(meta / "episodes_stats.jsonl", ({"episode_index": i, "stats": found} for i, found in enumerate(by_episode)))
        vectors = [name for name, part in self._statistics[0].items() if name not in self._cameras]
        together = {name: statistics.merged([found[name] for found in self._statistics]) for name in vectors}
        table.write_json(meta / "stats.json", {name: table.plain(part) for name, part in together.items()})
        table.write_json(meta / "modality.json", self.modality())
        table.write_json(meta / "info.json", self._info())

    def read(self, demonstration: Demonstration) -> Mapping[str, np.ndarray]:
        """Signals and pictures of one episode's files."""
        place = _place(demonstration.index)
        rows = table.read_rows(self._path / DATA.format(**place), ("observation.state", "action", "tick", "next.reward", "next.done"))
        counts = [video.count_pictures(self._path / VIDEO.format(video_key=key, **place)) for key in self._cameras]
        found = {"tick": rows["tick"], "reward": rows["next.reward"], "done": rows["next.done"], "frames": np.array(counts, int)}
        return found | self._apart(STATE, rows["observation.state"]) | self._apart(ACTION, rows["action"])

    def modality(self) -> dict[str, Any]:
        """meta/modality.json: which numbers of state and action are what."""
        parts, nu = self._all.anatomy.parts, len(self._all.anatomy.motors)
        state = {name: _range(*at) for name, at in parts.items()}
        state |= {f"{name}_velocity": _range(*at, nu) for name, at in parts.items()}
        state |= {name: _range(*at, 2 * nu) for name, at in BASE_PARTS.items()}
        action = {name: _range(*at) for name, at in parts.items()}
        action |= {f"command_{name}": _range(*at, nu) for name, at in COMMAND_PARTS.items()}
        return {
            "state": state,
            "action": action,
            "video": {name: {"original_key": key} for name, key in zip(self._names, self._cameras, strict=True)},
            "annotation": {TASK.removeprefix("annotation."): {}, VALID.removeprefix("annotation."): {}},
        }

    def _columns(self, demonstration: Demonstration) -> dict[str, np.ndarray]:
        count, signals = len(demonstration), demonstration.signals
        frame, task = np.arange(count), self._tasks.index(demonstration.task)
        valid = self._tasks.index("invalid" if demonstration.info.success is False else "valid", len(self._all.tasks))
        return {
            "observation.state": np.concatenate([signals[name] for name in STATE], axis=1).astype(np.float32),
            "action": np.concatenate([signals[name] for name in ACTION], axis=1).astype(np.float32),
            "timestamp": (frame / self._all.fps).astype(np.float32),
            "frame_index": frame,
            "episode_index": np.full(count, demonstration.index),
            "index": self._rows + frame,
            "task_index": np.full(count, task),
            TASK: np.full(count, task),
            VALID: np.full(count, valid),
            "tick": signals["tick"].astype(np.int64),
            "next.reward": signals["reward"].astype(np.float32),
            "next.done": signals["done"],
        }

    def _film(self, index: int, frames: Frames) -> dict[str, Statistics]:
        place = _place(index)
        paths = {key: self._path / VIDEO.format(video_key=key, **place) for key in self._cameras}
        return video.film(paths, self._size, self._all.fps, frames)

    def _apart(self, names: tuple[str, ...], joined: np.ndarray) -> dict[str, np.ndarray]:
        edges = np.cumsum([self._sizes[name] for name in names])[:-1]
        return dict(zip(names, np.split(joined, edges, axis=1), strict=True))

    def _info(self) -> dict[str, Any]:
        episodes = len(self._episodes)
        return {
            "codebase_version": VERSION,
            "robot_type": self._all.anatomy.robot,
            "total_episodes": episodes,
            "total_frames": self._rows,
            "total_tasks": len(self._tasks),
            "total_videos": episodes * len(self._cameras),
            "total_chunks": -(-episodes // FILES_A_CHUNK),
            "chunks_size": FILES_A_CHUNK,
            "fps": self._all.fps,
            "splits": {"train": f"0:{episodes}"},
            "data_path": DATA,
            "video_path": VIDEO if self._cameras else None,
            "features": self._features(),
        }

    def _features(self) -> dict[str, Any]:
        motors = self._all.anatomy.motors
        state = [*motors, *(f"{name}.velocity" for name in motors), *BASE]
        action = [*motors, *(f"command.{name}" for name in COMMAND)]
        width, height = self._size
        picture = {
            "dtype": "video",
            "shape": [height, width, 3],
            "names": ["height", "width", "channels"],
            "info": video.description(self._size, self._all.fps),
        }
        vectors = {
            name: {"dtype": "float32", "shape": [len(names)], "names": names}
            for name, names in (("observation.state", state), ("action", action))
        }
        kinds = {"timestamp": "float32", "next.reward": "float32", "next.done": "bool"} | dict.fromkeys(COUNTERS, "int64")
        return (
            vectors
            | {name: {"dtype": kind, "shape": [1], "names": None} for name, kind in kinds.items()}
            | dict.fromkeys(self._cameras, picture)
        )


def _range(start: int, stop: int, shift: int = 0) -> dict[str, int]:
    return {"start": start + shift, "end": stop + shift}


def _place(index: int) -> dict[str, int]:
    return {"episode_chunk": index // FILES_A_CHUNK, "episode_index": index}
