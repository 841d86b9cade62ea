"""Writes recorded episodes in another format: aside first, then read back row by row, then given its name."""

from __future__ import annotations

import importlib
import importlib.util
import shutil
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.exports import cameras
from app.exports.demonstration import Demonstration, Demonstrations
from app.exports.errors import ExportError, MissingPackage, NotWhatWasRecorded
from app.exports.format import Format, Frames
from app.exports.painter import Painter

FORMATS = {"lerobot": "LeRobot", "gr00t": "Gr00t", "robomimic": "Robomimic", "viser": "Viser", "csv": "Csv"}
"""Name, which is that of a module of this folder -> class."""


@dataclass(frozen=True)
class Look:
    """The pictures of an export."""

    cameras: tuple[str, ...] = ("head",)
    """`app.exports.cameras.NAMES`; none is allowed."""
    size: tuple[int, int] = (320, 240)
    """Width and height."""


@dataclass(frozen=True)
class Exported:
    """What was written and found to be what was recorded."""

    path: Path
    episodes: int
    rows: int
    pictures: int
    missing: int
    """Ticks that the recordings lack between the rows."""


def load(name: str) -> type[Format]:
    """The class of a format.

    Raises:
        MissingPackage: it needs a package that is not installed.
    """
    format = getattr(importlib.import_module(f"app.exports.{name}"), FORMATS[name])
    for package in format.packages:
        if importlib.util.find_spec(package) is None:
            raise MissingPackage(name, package)
    return format


def check(format: type[Format], look: Look) -> Look:
    """The pictures as this format can hold them.

    Raises:
        ExportError: an unknown camera, or a size that cannot be encoded.
    """
    unknown = set(look.cameras) - set(cameras.NAMES)
    if unknown:
        raise ExportError(f"there is no camera {', '.join(sorted(unknown))}; known cameras: {', '.join(cameras.NAMES)}, or none")
    if any(side < 16 or side > 4096 or side % 2 for side in look.size):
        raise ExportError(f"--size {look.size[0]}x{look.size[1]} cannot be encoded; both sides are even and from 16 to 4096")
    return look if format.pictures else Look((), look.size)


def export(format: type[Format], all: Demonstrations, output: Path, look: Look, advance: Callable[[int], None]) -> Exported:
    """Write, read back, rename.

    Args:
        format: from `load`.
        all: what to write.
        output: a folder that does not exist yet.
        look: from `check`.
        advance: told how many rows were written since the last call.

    Raises:
        ExportError: the folder exists, nothing can draw, or what was read back is not what was recorded.
        OSError: no room or no permission. Nothing is left behind.
    """
    if output.exists():
        raise ExportError(f"{output} exists already; delete it or choose another --output")
    if lacking := cameras.lacking(all.model, look.cameras):
        raise ExportError(f"the recorded {all.anatomy.robot} has no camera {', '.join(lacking)}; choose others with --cameras")
    aside = output.with_name(f".{output.name}.part")
    shutil.rmtree(aside, ignore_errors=True)  # of an export that was killed
    aside.mkdir(parents=True)
    try:
        with ExitStack() as stack:
            wrists = all.anatomy.wrists
            painter = stack.enter_context(Painter(all.model, look.cameras, look.size, wrists)) if look.cameras else None
            writer = format(aside, all, look.cameras, look.size)
            for demonstration in all:
                frames = painter.frames(demonstration.signals["qpos"]) if painter else ()
                writer.add(demonstration, _counted(frames, advance))
                advance(0 if painter else len(demonstration))
            writer.finish()
        rows = sum(_verify(writer, demonstration, len(look.cameras)) for demonstration in all)
        aside.rename(output)
    finally:
        shutil.rmtree(aside, ignore_errors=True)
    missing = sum(info.missing for info in all.infos)
    return Exported(output, len(all), rows, rows * len(look.cameras), missing)


def _counted(frames: Iterable[np.ndarray], advance: Callable[[int], None]) -> Frames:
    for frame in frames:
        advance(1)
        yield frame


def _verify(writer: Format, demonstration: Demonstration, cameras: int) -> int:
    """The rows of one episode, once every number read back was compared with the recording."""
    back, rows, name = dict(writer.read(demonstration)), len(demonstration), demonstration.info.id
    pictures = back.pop("frames")
    if pictures.tolist() != [rows] * cameras:
        raise NotWhatWasRecorded(name, "the pictures", f"are {pictures.tolist()} instead of {rows} a camera")
    for signal, values in back.items():
        recorded = demonstration.signals[signal]
        if values.shape != recorded.shape:
            raise NotWhatWasRecorded(name, signal, f"has the shape {values.shape} instead of {recorded.shape}")
        different = ~_same(values, recorded.astype(values.dtype), writer.tolerance).reshape(rows, -1).all(axis=1)
        if different.any():
            raise NotWhatWasRecorded(name, signal, f"differs in {different.sum()} of {rows} rows, first in row {different.argmax()}")
    return rows


def _same(values: np.ndarray, recorded: np.ndarray, tolerance: float) -> np.ndarray:
    if values.dtype.kind != "f":
        return values == recorded
    with np.errstate(invalid="ignore"):
        return (np.abs(values - recorded) <= tolerance) | (values == recorded) | (np.isnan(values) & np.isnan(recorded))
