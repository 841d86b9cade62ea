"""The session file being written: rows from the ring into the open episode. One thread uses it; others only look."""

from __future__ import annotations

import itertools
import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np

from policies.episode import Ending, EpisodeInfo, Metadata
from policies.recording.session_file import SessionFile, hidden_name
from policies.recording.writer import EpisodeWriter

_log = logging.getLogger(__name__)


class RowRing(Protocol):
    """The last rows of the simulation, as `app.shared.Ring` keeps them."""

    @property
    def count(self) -> int:
        """Rows ever pushed."""
        ...

    def since(self, number: int) -> tuple[list[np.void], int]:
        """Copies of the rows from `number` on, and how many of them are lost."""
        ...


class RecordingError(Exception):
    """An order to the recorder that it cannot follow now."""


class WrongMoment(RecordingError):
    """The order does not fit what is being recorded."""


class DiskFailed(RecordingError):
    """The disk is full, gone or hangs."""


@dataclass(frozen=True)
class _Session:
    file: SessionFile
    writer: EpisodeWriter


class Tape:
    """One session file at a time, one episode at a time.

    The file is made at the first episode. Another one follows when what makes the rows changed (a new policy), when the
    disk failed, or after `release`. Every method but `pump` raises DiskFailed when the disk does, and then the open
    episode is truncated.
    """

    def __init__(self, directory: Path, describe: Callable[[], tuple[Metadata, bytes | None]], rows: RowRing) -> None:
        """`describe` tells what makes the rows now and gives the model: policies.recording.provenance.describe."""
        self.directory = directory
        self.open: EpisodeInfo | None = None
        """The episode being recorded, as far as it is."""
        self.done: tuple[EpisodeInfo, ...] = ()
        """The finished episodes of the session file."""
        self.alarm: str | None = None
        """Why the last episode was truncated, until the next one starts."""
        self.busy_since: float | None = None
        """When the current write began, monotonic [s]; None between writes."""
        self._describe, self._rows, self._cursor = describe, rows, 0
        self._session: _Session | None = None
        self._number = 0

    @property
    def path(self) -> Path | None:
        """The session file; None before the first episode."""
        return None if self._session is None else self._session.file.path

    def pump(self) -> None:
        """Take what the simulation pushed since; keep it when an episode is open. Never raises."""
        rows, lost = self._rows.since(self._cursor)
        self._cursor += len(rows) + lost
        if self.open is None or self._session is None:
            return
        try:
            with self._disk():
                self._keep(self._session.writer, rows)
        except DiskFailed as error:
            _log.error("%s", error)

    def start(self, label: str, seed: int = 0) -> str:
        """Open an episode and return its id.

        Raises:
            WrongMoment: one is open already.
        """
        if self.open is not None:
            raise WrongMoment(f"episode {self.open.id} is being recorded; stop it first")
        metadata, model = self._describe()
        with self._disk():
            if self._session is not None and self._session.writer.metadata != metadata:
                self.release()
            if self._session is None:
                self._session = self._new_session(metadata, model)
            self.open = self._begin(self._session, label, seed)
        self.alarm, id = None, self.open.id
        self.pump()  # a disk that made the file slowly has let rows pile up
        return id

    def stop(self, id: str, ended: Ending, label: str | None = None, success: bool | None = None) -> EpisodeInfo:
        """Close the open episode and wait until the disk has it.

        Raises:
            WrongMoment: this episode is not open.
        """
        if self.open is None or self.open.id != id or self._session is None:
            raise DiskFailed(self.alarm) if self.alarm else WrongMoment(f"episode {id!r} is not being recorded")
        with self._disk():
            info = self._session.writer.end(time.time(), ended, label, success)
            self._session.file.sync()
        self.open, self.done = None, (*self.done, info)
        return info

    def label(self, id: str, label: str, success: bool | None) -> EpisodeInfo:
        """Another label and mark for a finished episode of the session file.

        Raises:
            WrongMoment: the file has no such episode.
        """
        old = next((info for info in self.done if info.id == id), None)
        if old is None or self._session is None:
            raise WrongMoment(f"there is no finished episode {id!r} in this session")
        with self._disk():
            self._session.writer.label(old.number, time.time(), label, success)
        new = replace(old, label=label, success=success)
        self.done = tuple(new if info is old else info for info in self.done)
        return new

    def discard(self, id: str) -> None:
        """Hide an episode of the session file, the open one included.

        Raises:
            WrongMoment: the file has no such episode.
        """
        if self.open is not None and self.open.id == id:
            self.stop(id, "stopped")
        gone = next((info for info in self.done if info.id == id), None)
        if gone is None or self._session is None:
            raise WrongMoment(f"there is no episode {id!r} in this session")
        with self._disk():
            self._session.writer.discard(gone.number, time.time())
        self.done = tuple(info for info in self.done if info is not gone)

    def release(self) -> None:
        """Complete the session file. The next episode makes another one.

        Raises:
            WrongMoment: an episode is open.
        """
        if self.open is not None:
            raise WrongMoment(f"episode {self.open.id} is being recorded; stop it first")
        if self._session is not None:
            with self._disk():
                self._session.writer.finish()
                self._session.file.sync()
            self._forget_session()

    def _keep(self, writer: EpisodeWriter, rows: list[np.void]) -> None:
        if rows:
            writer.rows(np.array(rows, dtype=writer.metadata.dtype))
            writer.flush()  # from here on they survive a kill -9
        self.open = writer.info

    def _new_session(self, metadata: Metadata, model: bytes | None) -> _Session:
        self.directory.mkdir(parents=True, exist_ok=True)
        stem = time.strftime("%Y-%m-%d_%H-%M-%S")
        names = itertools.chain([stem], (f"{stem}-{i}" for i in itertools.count(2)))
        paths = (self.directory / f"{name}.mcap" for name in names)
        file = SessionFile(next(path for path in paths if not path.exists() and not hidden_name(path).exists()))
        self._number = 0
        return _Session(file, EpisodeWriter(file, metadata, model))

    def _begin(self, session: _Session, label: str, seed: int) -> EpisodeInfo:
        self._number, path = self._number + 1, session.file.path
        id = f"{path.stem}_{self._number:03d}"
        session.writer.begin(EpisodeInfo(id, self._number, path, time.time(), label=label, seed=seed))
        session.writer.flush()
        if self._number == 1:
            session.file.publish()
        return session.writer.info

    @contextmanager
    def _disk(self) -> Iterator[None]:
        """Whatever goes wrong inside ends the episode and the file, and raises DiskFailed."""
        self.busy_since = time.monotonic()
        try:
            yield
        except DiskFailed:
            raise
        except Exception as error:
            if not isinstance(error, OSError):
                _log.exception("the recorder failed")
            what = "the recording could not be started" if self.open is None else f"episode {self.open.id} is truncated"
            self.alarm = f"{what}: {error}"
            self._forget_session()
            raise DiskFailed(self.alarm) from error
        finally:
            self.busy_since = None

    def _forget_session(self) -> None:
        if self._session is not None:
            self._session.file.close()
        self._session, self.open, self.done = None, None, ()
