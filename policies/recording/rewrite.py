"""Makes clean files out of others: one episode to take away, a crashed session, a file without what was discarded."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from policies.recording.reader import Recording
from policies.recording.session_file import SessionFile, in_use
from policies.recording.writer import EpisodeWriter


@dataclass(frozen=True)
class Recovered:
    """What `recover` found."""

    path: Path
    changed: bool
    """False: the file was complete and sound, it was left alone."""
    episodes: int
    rows: int
    missing: int
    """Ticks that are missing between the rows."""
    damaged: int
    """Chunks that could not be read, not counting one that a crash cut off at the end."""
    original: Path | None
    """Where the old file was kept: only when something was damaged."""


class RecordingInUse(Exception):
    """A file that a living program is still writing."""

    def __init__(self, path: Path) -> None:
        super().__init__(f"{path} is still being written; stop that program first")


def stream(recording: Recording, numbers: Collection[int]) -> Iterator[bytes]:
    """A complete MCAP file with these episodes, piece by piece."""
    pieces = _Pieces()
    writer = EpisodeWriter(pieces, recording.metadata, recording.packed_model())
    for info in recording.infos:
        if info.number not in numbers:
            continue
        writer.begin(info)
        for rows in recording.blocks(info.number):
            writer.rows(rows)
            writer.flush()
            yield pieces.take()
        writer.end(info.start + writer.info.seconds, "truncated" if info.ended == "open" else info.ended, info.label, info.success)
        yield pieces.take()
    writer.finish()
    yield pieces.take()


def recover(path: Path) -> Recovered:
    """Turn a truncated or damaged file into a complete one of the same name, with every row that can be read.

    Raises:
        DamagedRecording: nothing in it can be read, or not by this program.
        RecordingInUse: it is being written right now.
        OSError: no room or no permission; the file is as it was.
    """
    if in_use(path):
        raise RecordingInUse(path)
    with Recording(path, every_row=True) as recording:
        original = _unused(path.with_name(path.name + ".damaged")) if recording.damaged else None
        changed = not recording.finished or recording.damaged > 0
        if changed:
            _replace(recording, {info.number for info in recording.infos}, original)
        infos = recording.infos
        rows, missing = sum(info.rows for info in infos), sum(info.missing for info in infos)
        return Recovered(path, changed, len(infos), rows, missing, recording.damaged, original)


def keep_only(path: Path, numbers: Collection[int]) -> None:
    """Rewrite a file with these episodes alone; without any, the file goes.

    Raises:
        DamagedRecording, RecordingInUse, OSError: as `recover`; the file is as it was.
    """
    if in_use(path):
        raise RecordingInUse(path)
    if not numbers:
        path.unlink()
        return
    with Recording(path) as recording:
        _replace(recording, numbers, None)


def relabel(path: Path, number: int, label: str, success: bool | None) -> None:
    """Rewrite a file with another label and mark for one episode.

    Raises:
        DamagedRecording, RecordingInUse, OSError: as `recover`; the file is as it was.
    """
    if in_use(path):
        raise RecordingInUse(path)
    with Recording(path) as recording:
        told = {"label": label, "success": success}
        recording.infos = [replace(info, **told) if info.number == number else info for info in recording.infos]
        _replace(recording, {info.number for info in recording.infos}, None)


def _unused(path: Path) -> Path:
    """The path, or the first numbered one beside it that no file has."""
    names = itertools.chain([path], (path.with_name(f"{path.name}-{i}") for i in itertools.count(2)))
    return next(name for name in names if not name.exists())


def _replace(recording: Recording, numbers: Collection[int], original: Path | None) -> None:
    output = SessionFile(recording.path)
    try:
        for piece in stream(recording, numbers):
            output.write(piece)
            output.flush()
        output.sync()
        if original is not None:
            recording.path.rename(original)
        output.publish()
        output.sync()
    finally:
        output.close()


class _Pieces:
    """Collects written bytes until they are taken."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0

    def write(self, data: bytes) -> int:
        self._parts.append(bytes(data))
        self._size += len(data)
        return len(data)

    def tell(self) -> int:
        return self._size

    def flush(self) -> None:
        """Nothing to hand on: whoever asked for the pieces takes them."""

    def take(self) -> bytes:
        piece = b"".join(self._parts)
        self._parts.clear()
        return piece
