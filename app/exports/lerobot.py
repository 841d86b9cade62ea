"""LeRobot datasets, format v3.0: Parquet rows, MP4 pictures, one file of each an episode.

Layout and field names: huggingface/lerobot 0.6.1, `lerobot.datasets` (Apache-2.0).
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from app.exports import statistics, table, video
from app.exports.anatomy import BASE, COMMAND
from app.exports.demonstration import Demonstration, Demonstrations
from app.exports.format import Frames
from app.exports.statistics import Statistics

VERSION = "v3.0"
FILES_A_CHUNK = 1000
DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
EPISODES = "meta/episodes/chunk-000/file-000.parquet"

SIGNALS = {
    "observation.state": "position",
    "observation.velocity": "velocity",
    "observation.base": "base",
    "action": "target",
    "command": "command",
    "tick": "tick",
    "next.reward": "reward",
    "next.done": "done",
}
"""Feature -> signal of a demonstration. `command` is no input of a LeRobot policy unless it is renamed to action."""
TYPES = {"tick": "int64", "next.done": "bool"}
"""Of features that are not float32."""
COUNTERS = dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), "int64")


class LeRobot:
    """A folder that `LeRobotDataset(repo_id, root=FOLDER)` loads."""

    packages: ClassVar = ("pyarrow", "av")
    pictures: ClassVar = True
    fps: ClassVar = None
    tolerance: ClassVar = 0.0

    def __init__(self, path: Path, demonstrations: Demonstrations, cameras: tuple[str, ...], size: tuple[int, int]) -> None:
        self._path, self._all, self._size = path, demonstrations, size
        self._cameras = tuple(f"observation.images.{camera}" for camera in cameras)
        self._episodes: list[dict[str, Any]] = []
        self._statistics: dict[str, list[Statistics]] = defaultdict(list)
        self._rows = 0

    def add(self, demonstration: Demonstration, frames: Frames) -> None:
        """Rows, one video a camera, and what the list of episodes tells of them."""
        count = len(demonstration)
        columns = self._columns(demonstration)
        table.write_rows(self._path / DATA.format(**_place(demonstration.index)), columns)
        found = {name: statistics.of_values(values) for name, values in columns.items()} | self._film(demonstration.index, frames)
        for name, part in found.items():
            self._statistics[name].append(part)
        self._episodes.append(
            {
                "episode_index": demonstration.index,
                "tasks": [demonstration.task],
                "length": count,
                "dataset_from_index": self._rows,
                "dataset_to_index": self._rows + count,
                "meta/episodes/chunk_index": 0,
                "meta/episodes/file_index": 0,
                **{f"data/{name}": value for name, value in _place(demonstration.index).items()},
                **self._video_places(demonstration.index, count),
                **{f"stats/{name}/{key}": value.tolist() for name, part in found.items() for key, value in part.items()},
                "recording": demonstration.info.id,
                "success": demonstration.info.success,
            }
        )
        self._rows += count

    def finish(self) -> None:
        """The folder meta/."""
        table.write_records(self._path / EPISODES, self._episodes)
        tasks = [{"task_index": number, "task": task} for number, task in enumerate(self._all.tasks)]
        table.write_records(self._path / "meta/tasks.parquet", tasks, {"pandas": json.dumps(_TASK_INDEX)})
        table.write_json(
            self._path / "meta/stats.json", {name: table.plain(statistics.merged(parts)) for name, parts in self._statistics.items()}
        )
        table.write_json(self._path / "meta/info.json", self._info())

    def read(self, demonstration: Demonstration) -> Mapping[str, np.ndarray]:
        """Signals and pictures of one episode's files."""
        place = _place(demonstration.index)
        rows = table.read_rows(self._path / DATA.format(**place), SIGNALS)
        counts = [video.count_pictures(self._path / VIDEO.format(video_key=key, **place)) for key in self._cameras]
        return {SIGNALS[name]: values for name, values in rows.items()} | {"frames": np.array(counts, int)}

    def _columns(self, demonstration: Demonstration) -> dict[str, np.ndarray]:
        count = len(demonstration)
        frame = np.arange(count)
        columns = {name: demonstration.signals[signal].astype(TYPES.get(name, "float32")) for name, signal in SIGNALS.items()}
        return columns | {
            "timestamp": (frame / self._all.fps).astype(np.float32),
            "frame_index": frame,
            "episode_index": np.full(count, demonstration.index),
            "index": self._rows + frame,
            "task_index": np.full(count, self._all.tasks.index(demonstration.task)),
        }

    def _film(self, index: int, frames: Frames) -> dict[str, Statistics]:
        place = _place(index)
        paths = {key: self._path / VIDEO.format(video_key=key, **place) for key in self._cameras}
        return video.film(paths, self._size, self._all.fps, frames)

    def _video_places(self, index: int, count: int) -> dict[str, float]:
        times = {"from_timestamp": 0.0, "to_timestamp": count / self._all.fps}
        return {f"videos/{key}/{name}": value for key in self._cameras for name, value in (_place(index) | times).items()}

    def _info(self) -> dict[str, Any]:
        return {
            "codebase_version": VERSION,
            "robot_type": self._all.anatomy.robot,
            "total_episodes": len(self._episodes),
            "total_frames": self._rows,
            "total_tasks": len(self._all.tasks),
            "chunks_size": FILES_A_CHUNK,
            "data_files_size_in_mb": 100,
            "video_files_size_in_mb": 200,
            "fps": self._all.fps,
            "splits": {"train": f"0:{len(self._episodes)}"},
            "data_path": DATA,
            "video_path": VIDEO if self._cameras else None,
            "features": self._features(),
        }

    def _features(self) -> dict[str, Any]:
        motors = self._all.anatomy.motors
        names = {
            "observation.state": motors,
            "observation.velocity": motors,
            "observation.base": BASE,
            "action": motors,
            "command": COMMAND,
        }
        width, height = self._size
        picture = {
            "dtype": "video",
            "shape": [height, width, 3],
            "names": ["height", "width", "channels"],
            "info": video.description(self._size, self._all.fps),
        }
        types = {name: TYPES.get(name, "float32") for name in SIGNALS} | {"timestamp": "float32"} | COUNTERS
        vectors = {
            name: {"dtype": kind, "shape": [len(names.get(name, "1"))], "names": list(names[name]) if name in names else None}
            for name, kind in types.items()
        }
        return vectors | dict.fromkeys(self._cameras, picture)


def _place(index: int) -> dict[str, int]:
    return {"chunk_index": index // FILES_A_CHUNK, "file_index": index % FILES_A_CHUNK}


def _pandas_column(name: str, kind: str, numpy: str) -> dict[str, Any]:
    return {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None}


_TASK_INDEX = {
    "index_columns": ["task"],
    "column_indexes": [
        {"name": None, "field_name": None, "pandas_type": "unicode", "numpy_type": "object", "metadata": {"encoding": "UTF-8"}}
    ],
    "columns": [_pandas_column("task_index", "int64", "int64"), _pandas_column("task", "unicode", "object")],
    "creator": {"library": "pyarrow", "version": "0"},
    "pandas_version": "2.0.0",
}
"""Tells pandas that the column `task` is the index; LeRobot looks tasks up by it."""
