"""Writes every tick of an open episode to disk, from a thread of its own. Nothing here can slow the simulation."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from app.outputs.tape import DiskFailed, RecordingError, RowRing, Tape, WrongMoment
from policies.episode import EpisodeInfo, Metadata

T = TypeVar("T")

PUMP_PERIOD = 0.25
"""How often rows are taken from the ring and handed to the operating system as a chunk [s]. A kill -9 loses what came since; half a
second is allowed, the rest is for a busy machine. The MCAP library keeps an index entry a chunk (370 bytes) in memory until the file
is complete. The ring holds many seconds, so a disk may hang that long without a loss."""
SLOW_DISK = 1.0
"""A write that takes longer raises the alarm [s]."""
ANSWER_TIMEOUT = 10.0
"""How long a caller waits for a disk that hangs [s]."""


@dataclass(frozen=True)
class RecorderStatus:
    """What a page shows of the recorder."""

    open: EpisodeInfo | None
    """The episode being recorded, as far as it is: id, seconds, rows, gaps."""
    alarm: str | None
    """Why the last episode was truncated, or that the disk is slow; None when all is well."""


class Recorder:
    """A `Tape` and the thread that runs it. Every method may be called from any thread."""

    def __init__(self, directory: Path, describe: Callable[[], tuple[Metadata, bytes | None]], rows: RowRing) -> None:
        """Start the thread.

        Args:
            directory: where session files go; made when it is needed.
            describe: tells what makes the rows now and gives the model (policies.recording.provenance.describe); called at each
                episode's start, so it should have the answer ready.
            rows: the ring to drain.
        """
        self._tape = Tape(directory, describe, rows)
        self._orders: queue.Queue[Callable[[], None]] = queue.Queue(maxsize=16)
        self._running = True
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def start(self, label: str = "", seed: int = 0) -> str:
        """Open an episode and return its id; `seed` is that of the reset before it.

        Raises:
            WrongMoment: one is open already.
            DiskFailed: the file cannot be made or written.
        """
        return self._ask(lambda: self._tape.start(label, seed))

    def stop(self, id: str, label: str | None = None, success: bool | None = None) -> EpisodeInfo:
        """Close the open episode; when this returns, the disk has it. A label given here replaces the one of `start`.

        Raises:
            WrongMoment: this episode is not open.
            DiskFailed: the disk failed, the episode is truncated.
        """
        return self._ask(lambda: self._tape.stop(id, "stopped", label, success))

    def label(self, id: str, label: str, success: bool | None) -> EpisodeInfo:
        """Another label and mark for a finished episode of this session.

        Raises:
            WrongMoment: this session has no such episode.
            DiskFailed: the disk failed.
        """
        return self._ask(lambda: self._tape.label(id, label, success))

    def discard(self, id: str) -> None:
        """Hide an episode of this session, the open one included. Its space returns when its file is rewritten.

        Raises:
            WrongMoment: this session has no such episode.
            DiskFailed: the disk failed.
        """
        self._ask(lambda: self._tape.discard(id))

    def release(self) -> None:
        """Complete the session file, so that it may be rewritten; the next episode makes another one.

        Raises:
            WrongMoment: an episode is open.
            DiskFailed: the disk failed.
        """
        self._ask(self._tape.release)

    def status(self) -> RecorderStatus:
        """What is going on. Never waits."""
        alarm, busy_since = self._tape.alarm, self._tape.busy_since
        if busy_since is not None and time.monotonic() - busy_since > SLOW_DISK:
            alarm = f"the disk of {self._tape.directory} is slow: {time.monotonic() - busy_since:.0f} s for one write"
        return RecorderStatus(self._tape.open, alarm)

    def session(self) -> tuple[Path | None, tuple[EpisodeInfo, ...]]:
        """The file being written and its finished episodes. Never waits."""
        return self._tape.path, self._tape.done

    def close(self) -> None:
        """End an open episode, complete the file, end the thread."""
        if self._running:
            self._running = False
            self._thread.join(ANSWER_TIMEOUT)

    def _ask(self, order: Callable[[], T]) -> T:
        if not self._running:
            raise WrongMoment("the recorder is closed")
        answer: Future[T] = Future()

        def obey() -> None:
            try:
                answer.set_result(order())
            except Exception as error:
                answer.set_exception(error)

        try:
            self._orders.put(obey, timeout=ANSWER_TIMEOUT)
            return answer.result(ANSWER_TIMEOUT)
        except (queue.Full, TimeoutError) as error:
            raise DiskFailed(f"the disk of {self._tape.directory} does not answer") from error

    def _run(self) -> None:
        while self._running:
            try:
                order = self._orders.get(timeout=PUMP_PERIOD)
            except queue.Empty:
                order = None
            self._tape.pump()
            if order is not None:
                order()
        self._end()

    def _end(self) -> None:
        self._tape.pump()
        try:
            if self._tape.open is not None:
                self._tape.stop(self._tape.open.id, "closed")
            self._tape.release()
        except RecordingError:
            pass  # logged, and the file recovers at the next start
