"""Writes episodes into one MCAP file."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from mcap.writer import CompressionType, Writer

from policies.episode import Ending, EpisodeInfo, Metadata, holes, missing_ticks
from policies.recording.channels import EVENTS, PLOT, PLOT_EVERY, ROWS, declare, plot_message

PROFILE = "humanoid-teleop"
MODEL_ATTACHMENT = "model.mjb.zst"
"""The compiled MuJoCo model (MJB), compressed with zstd."""


class Output(Protocol):
    """Where the bytes go; what the MCAP library asks of a stream."""

    def write(self, data: bytes) -> int: ...
    def tell(self) -> int: ...
    def flush(self) -> None: ...


class EpisodeWriter:
    """One MCAP file of episodes, one after the other. Any method may raise what `output` raises.

    Rows since the last `flush` are lost when the program dies. A chunk of the file never holds rows of two episodes.
    """

    def __init__(self, output: Output, metadata: Metadata, packed_model: bytes | None) -> None:
        """`packed_model` is the compiled MuJoCo model (MJB), compressed with zstd."""
        self.metadata = metadata
        self._description = metadata.to_json()
        self._mcap = Writer(output, compression=CompressionType.ZSTD)  # pyright: ignore[reportArgumentType]  it only writes, tells and flushes
        self._mcap.start(profile=PROFILE)
        self._mcap.add_metadata("session", {key: json.dumps(value) for key, value in self._description.items()})
        if packed_model is not None:
            self._mcap.add_attachment(0, 0, MODEL_ATTACHMENT, "application/zstd", packed_model)
        declare(self._mcap, metadata)
        self._info: EpisodeInfo | None = None
        self._last_tick: int | None = None

    def begin(self, info: EpisodeInfo) -> None:
        """Open an episode: id, number, start, label and seed count, the rest is ignored."""
        self._info = replace(info, seconds=0.0, rows=0, success=None, gaps=0, missing=0, ended="open")
        self._last_tick = None
        start = {name: getattr(info, name) for name in ("id", "label", "start", "seed")}
        # The description in each start message survives damage elsewhere in the file.
        self._event(info.number, info.start, event="start", metadata=self._description, **start)

    @property
    def info(self) -> EpisodeInfo:
        """The open episode so far."""
        if self._info is None:
            raise RuntimeError("no episode is open")
        return self._info

    def rows(self, rows: np.ndarray) -> None:
        """Add rows of `metadata.dtype` [n] to the open episode; a jump in their ticks is counted and written as an event."""
        info = self.info
        gaps, missing = missing_ticks(rows["tick"], self._last_tick)
        for before, after in holes(rows["tick"], self._last_tick):
            self._event(info.number, float(rows["wall"][0]), event="gap", after_tick=before, next_tick=after)
        for row in rows:
            self._message(ROWS, info.number, float(row["wall"]), row.tobytes())
            if row["tick"] % PLOT_EVERY == 0:
                self._message(PLOT, info.number, float(row["wall"]), plot_message(row, self.metadata))
        if len(rows):
            self._last_tick = int(rows["tick"][-1])
        count = info.rows + len(rows)
        self._info = replace(info, rows=count, seconds=count / self.metadata.rate, gaps=info.gaps + gaps, missing=info.missing + missing)

    def end(self, wall: float, ended: Ending = "stopped", label: str | None = None, success: bool | None = None) -> EpisodeInfo:
        """Close the open episode and flush. A label given here replaces the one given at its start."""
        info = replace(self.info, ended=ended, success=success, label=self.info.label if label is None else label)
        kept = {name: getattr(info, name) for name in ("id", "start", "label", "success", "rows", "seconds", "gaps", "missing", "ended")}
        self._event(info.number, wall, event="stop", **kept)
        self._info = None
        self.flush()
        return info

    def label(self, number: int, wall: float, label: str, success: bool | None) -> None:
        """Another label and mark for a finished episode."""
        self._event(number, wall, event="label", label=label, success=success)
        self.flush()

    def discard(self, number: int, wall: float) -> None:
        """Hide a finished episode from now on; its rows go when the file is rewritten."""
        self._event(number, wall, event="discard")
        self.flush()

    def flush(self) -> None:
        """Finish the current chunk and hand everything to `output`."""
        self._mcap.flush()

    def finish(self) -> None:
        """Write the index that makes the file complete."""
        self._mcap.finish()

    def _event(self, number: int, wall: float, **values: Any) -> None:
        self._message(EVENTS, number, wall, json.dumps(values).encode())

    def _message(self, channel: int, number: int, wall: float, data: bytes) -> None:
        stamp = int(wall * 1e9) if 0 <= wall < 1e10 else 0  # a broken clock must not stop a recording
        self._mcap.add_message(channel, stamp, data, stamp, sequence=number)
