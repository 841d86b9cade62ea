"""The episodes of a folder of recordings."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from policies.episode import DamagedRecording, EpisodeInfo
from policies.recording.reader import Recording
from policies.recording.rewrite import RecordingInUse, Recovered, keep_only, recover, relabel, stream
from policies.recording.session_file import in_use

_log = logging.getLogger(__name__)


class Library:
    """Lists, reads and deletes episodes. Safe to use from several threads; what a file holds is remembered until it changes."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.damaged: dict[Path, str] = {}
        """Files of the last listing that cannot be read, with the reason."""
        self._known: dict[Path, tuple[tuple[int, int], list[EpisodeInfo]]] = {}
        self._listing, self._rewriting = threading.Lock(), threading.Lock()

    def files(self) -> list[Path]:
        """Recordings in the folder, oldest name first."""
        return sorted(path for path in self.directory.glob("*.mcap") if path.is_file() and not path.name.startswith("."))

    def infos(self, without: Path | None = None) -> list[EpisodeInfo]:
        """All episodes, newest first; `without` leaves a file out."""
        with self._listing:
            self.damaged = {}
            found = [info for path in self.files() if path != without for info in self._infos(path)]
        return sorted(found, key=lambda info: info.start, reverse=True)

    def stream(self, info: EpisodeInfo) -> Iterator[bytes]:
        """A complete MCAP file of one episode, piece by piece."""
        with Recording(info.file) as recording:
            yield from stream(recording, {info.number})

    def frames(self, info: EpisodeInfo, rate: float = 25.0) -> np.ndarray:
        """qpos of an episode for showing it, `rate` a second at most [n, nq] float32."""
        with Recording(info.file) as recording:
            metadata = recording.metadata
            every = max(round(metadata.rate / rate), 1)
            blocks = [metadata.qpos(rows)[rows["tick"] % every == 0] for rows in recording.blocks(info.number)]
        with np.errstate(over="ignore"):  # a diverged simulation is recorded too
            return np.concatenate([np.empty((0, metadata.nq)), *blocks]).astype(np.float32)

    def label(self, info: EpisodeInfo, label: str, success: bool | None) -> None:
        """Rewrite the episode's file with another label and mark for it.

        Raises:
            DamagedRecording, RecordingInUse, OSError: the file is as it was.
        """
        with self._rewriting:
            relabel(info.file, info.number, label, success)

    def delete(self, info: EpisodeInfo) -> None:
        """Rewrite the episode's file without it and without the discarded ones.

        Raises:
            DamagedRecording, RecordingInUse, OSError: the file is as it was.
        """
        with self._rewriting, Recording(info.file) as recording:
            keep_only(info.file, {other.number for other in recording.infos} - {info.number})

    def tidy(self) -> list[Recovered]:
        """Recover what crashes left behind and give back the space of discarded episodes; a file in use is left alone.

        A file that cannot be mended stays as it is and is logged.
        """
        with self._rewriting:
            for part in self.directory.glob(".*.mcap.part"):
                if not in_use(part):
                    part.unlink()
            return [done for path in self.files() if (done := _mend(path)) is not None and done.changed]

    def _infos(self, path: Path) -> list[EpisodeInfo]:
        try:
            stat = path.stat()
            stamp = (stat.st_size, stat.st_mtime_ns)
            known = self._known.get(path)
            if known is None or known[0] != stamp:
                with Recording(path) as recording:
                    known = self._known[path] = (stamp, recording.infos)
            return known[1]
        except FileNotFoundError:
            return []
        except (DamagedRecording, OSError) as error:
            self.damaged[path] = str(error)
            return []


def _mend(path: Path) -> Recovered | None:
    try:
        if in_use(path):
            return None
        with Recording(path) as recording:
            finished, discarded = recording.finished, recording.discarded
            numbers = {info.number for info in recording.infos}
        done = None if finished else recover(path)
        if finished and discarded:
            keep_only(path, numbers)
        return done
    except (DamagedRecording, RecordingInUse, OSError) as error:
        _log.warning("%s", error)
        return None
