"""Reads episodes back, from complete, live, truncated and damaged files alike."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import zstandard

from policies.episode import DamagedRecording, Episode, EpisodeInfo, Metadata, missing_ticks
from policies.recording.channels import ROWS
from policies.recording.container import LARGEST, read_attachment, read_chunk, read_session, survey
from policies.recording.contents import Contents, contents


class Recording:
    """One file, opened for reading. Use it in a `with` statement.

    Attributes:
        infos: its episodes in order, without the discarded ones.
        discarded: numbers of the episodes that were discarded and still take space.
        metadata: what made the rows.
        finished: the file was closed in order.
        damaged: chunks that turned out to be unreadable so far, not counting one that a crash cut off at the end.
    """

    def __init__(self, path: Path, every_row: bool = False) -> None:
        """Find the episodes; `every_row` reads and checks the whole file to do so.

        Raises:
            DamagedRecording: not a recording of this program, another format, or nothing readable in it.
            OSError: no such file, no permission.
        """
        self.path = path
        self._file = path.open("rb")
        try:
            layout = survey(self._file)
            found = contents(self._file, layout, every_row)
            self.metadata = self._metadata(found)
        except ValueError as error:
            self._file.close()
            raise DamagedRecording(path, str(error), "read it with the program and version that wrote it") from error
        except BaseException:
            self._file.close()
            raise
        self._model_at, self._chunks = layout.model, found.chunks
        self.finished, self.damaged, self.discarded = layout.finished, found.damaged, frozenset(found.discarded)
        kept = (number for number in sorted(found.chunks) if number not in found.discarded)
        self.infos = [found.info(number, path, self.metadata.rate) for number in kept]

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def blocks(self, number: int) -> Iterator[np.ndarray]:
        """Rows of an episode, some at a time. Chunks that cannot be read are left out and counted in `damaged`."""
        for offset in self._chunks.get(number, ()):
            chunk = read_chunk(self._file, offset)
            if chunk is None:
                self.damaged += 1
                continue
            rows = [m.data for m in chunk[0] if m.channel_id == ROWS and m.sequence == number]
            whole = [row for row in rows if len(row) == self.metadata.dtype.itemsize]
            if whole:
                yield np.frombuffer(b"".join(whole), dtype=self.metadata.dtype)

    def episode(self, info: EpisodeInfo) -> Episode:
        """One of `infos` with all its rows in memory (about 7 kB a row). Its counts are those of the rows that could be read."""
        blocks = list(self.blocks(info.number))
        rows = np.concatenate(blocks) if blocks else np.empty(0, self.metadata.dtype)
        gaps, missing = missing_ticks(rows["tick"])
        read = replace(info, rows=len(rows), seconds=len(rows) / self.metadata.rate, gaps=gaps, missing=missing)
        return Episode(read, self.metadata, rows, self.model())

    def episodes(self) -> Iterator[Episode]:
        """All episodes in order."""
        return (self.episode(info) for info in self.infos)

    def packed_model(self) -> bytes | None:
        """The attached model as it stands in the file; None when it is damaged or was never attached."""
        return None if self._model_at is None else read_attachment(self._file, self._model_at)

    def model(self) -> bytes | None:
        """The compiled MuJoCo model (MJB); None when it is damaged or was never attached."""
        packed = self.packed_model()
        try:
            if packed is None or zstandard.get_frame_parameters(packed).content_size > LARGEST:
                return None
            return zstandard.decompress(packed)
        except zstandard.ZstdError:
            return None

    def _metadata(self, found: Contents) -> Metadata:
        described = [start["metadata"] for start in found.starts.values()] or [read_session(self._file)]
        if not found.chunks or not any(described):
            raise DamagedRecording(self.path, "it holds no readable episode", "choose a file that `teleop` recorded")
        return Metadata.from_json(described[0])
