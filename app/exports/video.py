"""Pictures as MP4 files that every player and training library decodes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from app.exports.statistics import Brightness, Statistics

CODEC, PIXELS, GROUP, QUALITY = "h264", "yuv420p", 2, 20
"""H.264; a key frame every second picture, so that a training run may jump to any of them; constant rate factor."""


class Video:
    """One file being written, in a `with` statement."""

    def __init__(self, path: Path, size: tuple[int, int], fps: int) -> None:
        """`size` is width and height, both even."""
        import av

        self._av = av
        path.parent.mkdir(parents=True, exist_ok=True)
        self._container = av.open(str(path), "w", options={"fflags": "+bitexact"})  # no date: the same pictures give the same bytes
        self._stream = self._container.add_stream("libx264", rate=fps)
        self._stream.width, self._stream.height = size
        self._stream.pix_fmt = PIXELS
        self._stream.options = {"g": str(GROUP), "crf": str(QUALITY), "preset": "veryfast", "threads": "1"}

    def __enter__(self) -> Video:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if kind is None:
            self._container.mux(self._stream.encode(None))
        self._container.close()

    def add(self, picture: np.ndarray) -> None:
        """One more [height, width, 3] uint8."""
        frame = self._av.VideoFrame.from_ndarray(picture, format="rgb24")
        self._container.mux(self._stream.encode(frame))


def film(paths: Mapping[str, Path], size: tuple[int, int], fps: int, frames: Iterator[np.ndarray]) -> dict[str, Statistics]:
    """One file a camera from `app.exports.format.Frames`, in the order of the paths; returns what the pictures were like."""
    seen = {key: Brightness() for key in paths}
    with ExitStack() as files:
        films = {key: files.enter_context(Video(path, size, fps)) for key, path in paths.items()}
        for pictures in frames:
            for key, picture in zip(paths, pictures, strict=True):
                films[key].add(picture)
                seen[key].see(picture)
    return {key: brightness.statistics() for key, brightness in seen.items()}


def count_pictures(path: Path) -> int:
    """How many pictures can be decoded from a file."""
    import av

    with av.open(str(path)) as container:
        return sum(1 for _ in container.decode(video=0))


def description(size: tuple[int, int], fps: int) -> dict[str, Any]:
    """What LeRobot keeps of a video beside its name."""
    width, height = size
    shape = {"video.height": height, "video.width": width, "video.channels": 3, "video.fps": fps}
    return shape | {"video.codec": CODEC, "video.pix_fmt": PIXELS, "video.is_depth_map": False, "has_audio": False}
