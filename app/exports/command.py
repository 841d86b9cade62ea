"""What `teleop export` does: prints how it goes and returns the exit code."""

from __future__ import annotations

import sys
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from app.exports import export as exports
from app.exports.demonstration import Choice, Demonstrations
from app.exports.errors import ExportError
from policies.episode import DamagedRecording
from policies.recording.model import CannotReplay


def export(paths: list[Path], format: str, output: Path | None, choice: Choice, look: exports.Look, fps: int | None) -> int:
    """Write episodes of recordings in another format. Returns 1 when that is not possible.

    Raises:
        AppError, RobotError: with a sentence for the person who asked.
    """
    written = exports.load(format)
    look = exports.check(written, look)
    try:
        all = Demonstrations(paths, choice, fps or written.fps)
        output = output or Path(f"{paths[0].stem or 'recordings'}_{format}")
        with _bar() as bar:
            task = bar.add_task(f"{len(all)} episodes as {format}", total=all.rows)
            done = exports.export(written, all, output, look, lambda rows: bar.advance(task, rows))
    except (DamagedRecording, CannotReplay, OSError) as error:
        print(f"teleop: {error}", file=sys.stderr)
        return 1
    pictures = f", {done.pictures} pictures" if done.pictures else ""
    gaps = f"; the recordings lack {done.missing} ticks, their neighbours stand side by side" if done.missing else ""
    print(f"{done.path}: {done.episodes} episodes, {done.rows} rows{pictures}, read back and equal to the recording{gaps}")
    return 0


def look(cameras: tuple[str, ...], size: str) -> exports.Look:
    """The pictures that were asked for.

    Raises:
        ExportError: the size is not WIDTHxHEIGHT.
    """
    width, cross, height = size.partition("x")
    if not (cross and width.isdecimal() and height.isdecimal()):
        raise ExportError(f"--size {size} is not understood; write it as 320x240")
    return exports.Look(() if cameras == ("none",) else cameras, (int(width), int(height)))


def _bar() -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("rows"), TimeRemainingColumn())
    return Progress(*columns, console=Console(stderr=True), transient=True)
