"""Finds the chunks of an MCAP file: by its index when the file is complete, by search when it is not."""

from __future__ import annotations

import io
import itertools
import json
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, BinaryIO

import zstandard
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Chunk, ChunkIndex, Message, Metadata
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC

from policies.recording.channels import EVENTS
from policies.recording.writer import MODEL_ATTACHMENT

_CHUNK = struct.Struct("<BQQQQI8sQ")
"""Head of a chunk record: opcode, length, first and last time, plain size, CRC of the plain bytes, "zstd" with its length, packed size."""
_ZSTD = struct.pack("<I4s", 4, b"zstd")
_ZSTD_AT = 37
_ATTACHMENT_NAME = struct.pack("<I", len(MODEL_ATTACHMENT)) + MODEL_ATTACHMENT.encode()
_ATTACHMENT_NAME_AT = 25
_FOOTER = struct.Struct("<BQQQI")
LARGEST = 64 << 20
"""No chunk or model of ours is larger [bytes]; a damaged size must not take all memory."""
_BROKEN = (McapError, zstandard.ZstdError, struct.error, ValueError, KeyError, OverflowError)


@dataclass(frozen=True)
class Place:
    """One chunk."""

    offset: int
    events: bool
    """It holds messages of the event channel."""


@dataclass(frozen=True)
class Layout:
    """Where things stand in one file."""

    finished: bool
    """The file was closed in order and its index is intact."""
    chunks: tuple[Place, ...]
    model: int | None
    """Offset of the attached model."""
    damaged: int = 0
    """Chunks that were found but cannot be read; one that the end of the file cuts off is none."""


def survey(file: BinaryIO) -> Layout:
    """Find everything in the file. Without an index every chunk is read and checked once."""
    return _indexed(file) or _searched(file)


def read_chunk(file: BinaryIO, offset: int) -> tuple[list[Message], int] | None:
    """Messages of the chunk at `offset` and the offset behind it; None when it is cut off or its CRC does not fit."""
    head = _read(file, offset, _CHUNK.size)
    if len(head) < _CHUNK.size:
        return None
    _, _, _, _, size, crc, compression, packed_size = _CHUNK.unpack(head)
    if compression != _ZSTD or size > LARGEST or packed_size > LARGEST:
        return None
    packed = _read(file, offset + _CHUNK.size, packed_size)
    try:
        if len(packed) < packed_size or zstandard.get_frame_parameters(packed).content_size != size:
            return None
        plain = zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
        if zlib.crc32(plain) != crc:
            return None
        return _messages(plain), offset + _CHUNK.size + packed_size
    except _BROKEN:
        return None


def read_attachment(file: BinaryIO, offset: int) -> bytes | None:
    """The bytes attached at `offset`; None when they are damaged."""
    try:
        length = struct.unpack("<BQ", _read(file, offset, 9))[1]
        record = _read(file, offset + 9, min(length, LARGEST))
        if zlib.crc32(record[:-4]) != struct.unpack("<I", record[-4:])[0]:
            return None
        media = 16 + 4 + struct.unpack_from("<I", record, 16)[0]
        start = media + 4 + struct.unpack_from("<I", record, media)[0] + 8
        return record[start:-4]
    except _BROKEN:
        return None


def read_session(file: BinaryIO) -> dict[str, Any]:
    """The description near the start of the file, as JSON values; empty when it is damaged."""
    file.seek(0)
    try:
        for record in itertools.islice(StreamReader(file).records, 2):
            if isinstance(record, Metadata):
                return {key: json.loads(value) for key, value in record.metadata.items()}
    except _BROKEN:
        pass
    return {}


def _indexed(file: BinaryIO) -> Layout | None:
    """By the summary at the end of a file; None when there is none or its CRC does not fit."""
    end = file.seek(0, io.SEEK_END)
    tail_size = _FOOTER.size + len(MCAP0_MAGIC)
    tail = _read(file, max(end - tail_size, 0), tail_size)
    if len(tail) < tail_size or tail[_FOOTER.size :] != MCAP0_MAGIC:
        return None
    opcode, _, start, _, crc = _FOOTER.unpack(tail[: _FOOTER.size])
    if opcode != Opcode.FOOTER or not 0 < start < end - tail_size:
        return None
    summary = _read(file, start, end - tail_size - start)
    if zlib.crc32(tail[: _FOOTER.size - 4], zlib.crc32(summary)) != crc:
        return None
    chunks, model = [], None
    try:
        for record in StreamReader(io.BytesIO(summary + tail), skip_magic=True).records:
            if isinstance(record, ChunkIndex):
                chunks.append(Place(record.chunk_start_offset, EVENTS in record.message_index_offsets))
            elif isinstance(record, AttachmentIndex) and record.name == MODEL_ATTACHMENT:
                model = record.offset
    except _BROKEN:
        return None
    return Layout(True, tuple(chunks), model)


def _searched(file: BinaryIO) -> Layout:
    """By the marks that every chunk and the model carry; the CRC tells a chunk from bytes that look like one."""
    chunks, broken, behind = [], [], 0
    for at in _find(file, _ZSTD):
        offset = at - _ZSTD_AT
        if offset < behind:
            continue  # inside the chunk before
        chunk = read_chunk(file, offset)
        if chunk is not None:
            messages, behind = chunk
            chunks.append(Place(offset, any(m.channel_id == EVENTS for m in messages)))
        elif _read(file, offset, 1) == bytes([Opcode.CHUNK]):  # the index of a file carries the same mark
            broken.append(offset)
    cut_off = bool(broken) and broken[-1] >= behind and _ends_early(file, broken[-1])
    models = (at - _ATTACHMENT_NAME_AT for at in _find(file, _ATTACHMENT_NAME))
    model = next((offset for offset in models if offset >= 0 and read_attachment(file, offset) is not None), None)
    return Layout(False, tuple(chunks), model, len(broken) - cut_off)


def _ends_early(file: BinaryIO, offset: int) -> bool:
    """Whether the chunk at `offset` claims to be longer than the file."""
    head = _read(file, offset, _CHUNK.size)
    return len(head) < _CHUNK.size or offset + 9 + _CHUNK.unpack(head)[1] > file.seek(0, io.SEEK_END)


def _find(file: BinaryIO, mark: bytes) -> Iterator[int]:
    """Offsets of a byte string in the file, read piece by piece."""
    offset, kept = 0, b""
    while piece := _read(file, offset + len(kept), 1 << 22):
        window = kept + piece
        at = window.find(mark)
        while at >= 0:
            yield offset + at
            at = window.find(mark, at + 1)
        kept = window[-(len(mark) - 1) :]
        offset += len(window) - len(kept)


def _read(file: BinaryIO, offset: int, size: int) -> bytes:
    file.seek(max(offset, 0))
    return file.read(size)


def _messages(plain: bytes) -> list[Message]:
    chunk = Chunk(compression="", data=plain, message_start_time=0, message_end_time=0, uncompressed_crc=0, uncompressed_size=len(plain))
    return [record for record in breakup_chunk(chunk) if isinstance(record, Message)]
