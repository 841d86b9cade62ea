"""robomimic datasets: one HDF5 file with a group an episode.

Layout: ARISE-Initiative/robomimic, docs/datasets/overview.md (MIT).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from app.exports.demonstration import Demonstration, Demonstrations
from app.exports.format import Frames

FILE = "demonstrations.hdf5"
OBSERVATIONS = ("position", "velocity", "base", "command")
GYM = 2
"""robomimic's number of the kind of environment whose states it does not interpret."""


class Robomimic:
    """A file for `robomimic.scripts.train --dataset FILE`."""

    packages: ClassVar = ("h5py",)
    pictures: ClassVar = True
    fps: ClassVar = None
    tolerance: ClassVar = 0.0

    def __init__(self, path: Path, demonstrations: Demonstrations, cameras: tuple[str, ...], size: tuple[int, int]) -> None:
        import h5py

        self._all, self._size, self._rows = demonstrations, size, 0
        self._cameras = tuple(f"{camera}_image" for camera in cameras)
        self._path = path / FILE
        self._marked: dict[str, list[str]] = {}
        self._file = h5py.File(self._path, "w", libver="v110")
        self._data = self._file.create_group("data", track_order=True)

    def add(self, demonstration: Demonstration, frames: Frames) -> None:
        """The group demo_N."""
        signals, name = demonstration.signals, f"demo_{demonstration.index}"
        group = self._data.create_group(name)
        group.attrs.update({"num_samples": len(demonstration), "task": demonstration.task, "recording": demonstration.info.id})
        for key, values in {
            "states": signals["state"],
            "actions": self._normalised(signals["target"]),
            "actions_abs": signals["target"],
            "rewards": signals["reward"],
            "dones": signals["done"].astype(np.int64),
            "ticks": signals["tick"],
        }.items():
            group.create_dataset(key, data=values)
        for key in OBSERVATIONS:
            group.create_dataset(f"obs/{key}", data=signals[key])
            group.create_dataset(f"next_obs/{key}", data=_next(signals[key]))
        self._film(group, len(demonstration), frames)
        self._rows += len(demonstration)
        if demonstration.info.success is not None:
            self._marked.setdefault("success" if demonstration.info.success else "failure", []).append(name)

    def finish(self) -> None:
        """Totals and filter keys."""
        model, names = self._all.model, self._all.anatomy
        self._data.attrs["total"] = self._rows
        kwargs = {"robot": names.robot, "motors": names.motors, "control_freq": self._all.fps, "nq": model.nq, "nv": model.nv}
        kwargs |= {"action_low": names.lower.tolist(), "action_high": names.upper.tolist()}
        environment = {"env_name": f"humanoid-teleop-{names.robot}", "env_type": GYM, "env_kwargs": kwargs}
        self._data.attrs["env_args"] = json.dumps(environment)
        for key, demos in self._marked.items():
            self._file.create_dataset(f"mask/{key}", data=np.array(demos, dtype="S"))
        self._file.close()

    def read(self, demonstration: Demonstration) -> Mapping[str, np.ndarray]:
        """Signals and pictures of one group."""
        import h5py

        with h5py.File(self._path) as file:
            group: Any = file[f"data/demo_{demonstration.index}"]
            found = {key: group[f"obs/{key}"][:] for key in OBSERVATIONS}
            kept = {"state": "states", "target": "actions_abs", "reward": "rewards", "tick": "ticks"}
            found |= {signal: group[key][:] for signal, key in kept.items()}
            counts = [group[f"obs/{key}"].id.get_num_chunks() for key in self._cameras]  # a picture each
            return found | {"done": group["dones"][:].astype(bool), "frames": np.array(counts, int)}

    def _normalised(self, target: np.ndarray) -> np.ndarray:
        """Joint limits become -1 and 1, as robomimic asks of actions."""
        lower, upper = self._all.anatomy.lower, self._all.anatomy.upper
        return np.clip(2 * (target - lower) / (upper - lower) - 1, -1, 1)

    def _film(self, group: Any, count: int, frames: Frames) -> None:
        width, height = self._size
        shape, options = (count, height, width, 3), {"dtype": "u1", "chunks": (1, height, width, 3), "compression": "gzip"}
        now = [group.create_dataset(f"obs/{key}", shape, **options) for key in self._cameras]
        then = [group.create_dataset(f"next_obs/{key}", shape, **options) for key in self._cameras]
        for row, pictures in enumerate(frames):
            for here, ahead, picture in zip(now, then, pictures, strict=True):
                here[row] = picture
                ahead[max(row - 1, 0)] = picture
                if row == count - 1:
                    ahead[row] = picture


def _next(values: np.ndarray) -> np.ndarray:
    """The row after; the last one stays."""
    return np.concatenate([values[1:], values[-1:]])
