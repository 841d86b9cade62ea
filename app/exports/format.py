"""What a format is to the rest of the program."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import ClassVar, Protocol

import numpy as np

from app.exports.demonstration import Demonstration, Demonstrations

Frames = Iterator[np.ndarray]
"""What the cameras see at each row in turn: [cameras, height, width, 3] uint8."""


class Format(Protocol):
    """Writes one kind of file: `add` every demonstration in order, then `finish`; `read` gives back what was written.

    Siblings of this folder implement it and never import each other.
    """

    packages: ClassVar[tuple[str, ...]]
    """Modules it needs beyond those of the program."""
    pictures: ClassVar[bool]
    """Whether it holds camera pictures."""
    fps: ClassVar[int | None]
    """Rows a second unless others are asked for; None: all of them."""
    tolerance: ClassVar[float]
    """How far a number read back may be from the recorded one in the format's own number type."""

    def __init__(self, path: Path, demonstrations: Demonstrations, cameras: tuple[str, ...], size: tuple[int, int]) -> None:
        """Start to write at `path`, a folder that exists and is empty; `size` is width and height of a picture."""
        ...

    def add(self, demonstration: Demonstration, frames: Frames) -> None:
        """Write one episode. Without cameras `frames` is empty."""
        ...

    def finish(self) -> None:
        """Write what describes all episodes."""
        ...

    def read(self, demonstration: Demonstration) -> Mapping[str, np.ndarray]:
        """Signals of `Demonstration` as the files of this export hold them, in their own number format; under "frames" the
        number of pictures of each camera."""
        ...
