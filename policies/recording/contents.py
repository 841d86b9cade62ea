"""Which episodes a file holds and in which chunks their rows stand."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from mcap.records import Message

from policies.episode import EpisodeInfo, missing_ticks
from policies.recording.channels import EVENTS, ROWS
from policies.recording.container import Layout, read_chunk

_ROW_START = struct.Struct("<Qdd")
"""tick, time and wall: the first fields of every row, whatever its layout."""


@dataclass
class Contents:
    """Gathered chunk by chunk, in file order; keys are episode numbers."""

    chunks: dict[int, list[int]] = field(default_factory=dict)
    """Offsets of the chunks that may hold rows of an episode."""
    starts: dict[int, dict[str, Any]] = field(default_factory=dict)
    stops: dict[int, dict[str, Any]] = field(default_factory=dict)
    labels: dict[int, dict[str, Any]] = field(default_factory=dict)
    """Afterthoughts about finished episodes."""
    discarded: set[int] = field(default_factory=set)
    damaged: int = 0
    """Chunks that could not be read."""
    counted: bool = False
    """Every row was looked at, because the file has no index or a part of it is damaged."""
    ticks: dict[int, list[int]] = field(default_factory=dict)
    walls: dict[int, float] = field(default_factory=dict)
    """Unix time of the first row [s]."""

    def info(self, number: int, file: Path, rate: float) -> EpisodeInfo:
        """The list entry of an episode, as good as the file still knows it."""
        told: dict[str, Any] = self.starts.get(number, {}) | self.stops.get(number, {"ended": "truncated"})
        told |= self.labels.get(number, {})
        told = {"id": f"{file.stem}_{number:03d}", "start": self.walls.get(number, 0.0)} | told | {"number": number, "file": file}
        if self.counted:
            ticks = np.array(self.ticks.get(number, []), dtype=np.uint64)
            gaps, missing = missing_ticks(ticks)
            told |= {"rows": len(ticks), "seconds": len(ticks) / rate, "gaps": gaps, "missing": missing}
        return EpisodeInfo(**{name: told[name] for name in EpisodeInfo.__dataclass_fields__ if name in told})

    def _place(self, number: int, offset: int) -> None:
        offsets = self.chunks.setdefault(number, [])
        if offsets[-1:] != [offset]:
            offsets.append(offset)

    def _event(self, number: int, event: dict[str, Any]) -> None:
        match event.get("event"):
            case "start":
                self.starts[number] = event
            case "stop":
                self.stops[number] = event
            case "label":
                self.labels[number] = event
            case "discard":
                self.discarded.add(number)

    def _row(self, number: int, data: bytes) -> None:
        tick, _, wall = _ROW_START.unpack_from(data)
        self.ticks.setdefault(number, []).append(tick)
        self.walls.setdefault(number, wall)


def contents(file: BinaryIO, layout: Layout, every_row: bool) -> Contents:
    """What stands in the file. A complete file tells it by its start and stop messages; else, or when asked, every row is looked at.

    Raises:
        ValueError: a message is not what this program writes.
    """
    try:
        by_events = None if every_row or not layout.finished else _by_events(file, layout)
        return _by_rows(file, layout) if by_events is None else by_events
    except (struct.error, KeyError, IndexError, TypeError, AttributeError) as error:
        raise ValueError(f"it holds a message of another kind ({error})") from error


def _by_events(file: BinaryIO, layout: Layout) -> Contents | None:
    found, current = Contents(), 0
    for place in layout.chunks:
        if place.events:
            chunk = read_chunk(file, place.offset)
            if chunk is None:
                return None
            for message in chunk[0]:
                found._place(message.sequence, place.offset)
                if message.channel_id == EVENTS:
                    event = json.loads(message.data)
                    found._event(message.sequence, event)
                    if event.get("event") == "start":  # any other one may be about an earlier episode
                        current = message.sequence
        else:
            found._place(current, place.offset)
    return found


def _by_rows(file: BinaryIO, layout: Layout) -> Contents:
    found = Contents(damaged=layout.damaged, counted=True)
    for place in layout.chunks:
        chunk = read_chunk(file, place.offset)
        if chunk is None:
            found.damaged += 1
            continue
        for message in chunk[0]:
            _message(found, message, place.offset)
    return found


def _message(found: Contents, message: Message, offset: int) -> None:
    number = message.sequence
    found._place(number, offset)
    if message.channel_id == EVENTS:
        found._event(number, json.loads(message.data))
    elif message.channel_id == ROWS:
        found._row(number, message.data)
