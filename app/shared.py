"""Memory that the web process and the simulation share: the newest command, the newest snapshot, the last rows.

The memory has no name. Nothing can leak under /dev/shm: the kernel frees it with the last process that maps it, kill -9 included.
"""

from __future__ import annotations

import mmap
import os
import tempfile
import zlib
from dataclasses import dataclass
from multiprocessing import reduction

import numpy as np

from policies import command

COMMAND = np.dtype(
    [
        ("stamp", "<i8", (2,)),  # a role (app.arbiter.ROLES): time.monotonic_ns of its driver's newest message; 0: nobody drives
        ("engage", "u1", (2,)),  # a role: 1 while its driver holds Engage
        ("driver", "<u4", (2,)),  # a role: counts leases; a new number is a new driver; 0: nobody yet
        ("presses", "<u4", (2,)),  # a role: counts fresh presses of Engage
        ("vector", "<f8", (command.SIZE,)),  # Command.vector, merged from all drivers
        ("given", "u1", (2,)),  # 1: the driver of the arms has set this wrist since pressing Engage (left, right)
        ("smooth", "u1"),  # 1: the wrists' targets are filtered
        ("stops", "<u4"),  # counts presses of Stop
        ("resets", "<u4"),  # counts presses of Reset
        ("seed", "<u4"),  # of the newest reset: 0 is home, another one draws a start near it
        ("policy", "u1"),  # which leg weights shall walk: an index into the names that the simulation was started with
    ]
)
"""What the web process asks."""


def snapshot_dtype(nq: int, upper: int) -> np.dtype:
    """What the simulation publishes after each tick. Poses: position [m] and quaternion wxyz, in the pelvis frame.

    Args:
        nq: length of the play model's qpos.
        upper: joints of waist and arms.
    """
    return np.dtype(
        [
            ("tick", "<u8"),  # the row of this tick has the same number
            ("stamp", "<i8"),  # time.monotonic_ns of publishing
            ("time", "<f8"),  # simulated time [s]
            ("qpos", "<f8", (nq,)),
            ("base", "<f8", (9,)),  # x, y, z [m], yaw, roll, pitch [rad], vx, vy [m/s], yaw rate [rad/s] (velocities: heading frame)
            ("applied", "<f8", (command.SIZE,)),  # Command.vector after the guard
            ("target", "<f8", (2, 7)),  # wrists as asked for (left, right); as applied where nobody asks
            ("reachable", "<f8", (2, 7)),  # the nearest pose that the arm can take
            ("actual", "<f8", (2, 7)),  # where the wrists are
            ("upper", "<f4", (upper,)),  # where waist and arms are told to go, as the motion prior sees it [rad]
            ("limited_by", "S12", (2,)),  # why reachable is not target: policies.reach.Reached.reasons
            ("let_go", "u1", (2,)),  # 1: this wrist's target jumped and the arm holds
            ("latency", "<f4", (6,)),  # ms, policies.episode.STAGES
            ("filter", "<f4"),  # what the filter of the wrists' targets delays them by [ms]
            ("missed", "<u8"),  # ticks skipped because the process was late, since its start
            ("rejected", "<u8"),  # commands that the guard refused, since its start
            ("mode", "u1"),
            ("reason", "u1"),
            ("modes", "u1", (2,)),  # a role (app.arbiter.ROLES)
            ("reasons", "u1", (2,)),
            ("upright", "u1"),
            ("policy", "u1"),  # which leg weights walked, as in COMMAND
            ("jump", "u1"),  # 1: the state was set from outside before this tick
        ]
    )


@dataclass(frozen=True)
class Layout:
    """Sizes that depend on the robot and its policy. The simulation knows them and tells the web process."""

    nq: int
    """Length of the play model's qpos."""
    upper: int
    """Joints of waist and arms."""
    row: np.dtype
    """policies.episode.row_dtype of this robot and policy."""


class Memory:
    """An anonymous file. It travels to a spawned process as an argument."""

    def __init__(self) -> None:
        if hasattr(os, "memfd_create"):
            self.fd = os.memfd_create("teleop")
        else:  # not Linux: a file that is unlinked at once
            with tempfile.TemporaryFile() as file:
                self.fd = os.dup(file.fileno())

    def map(self, size: int) -> np.ndarray:
        """Its first `size` bytes [size], shared with every process that maps them; zero at first."""
        if os.fstat(self.fd).st_size < size:
            os.ftruncate(self.fd, size)
        return np.frombuffer(mmap.mmap(self.fd, size), dtype=np.uint8)

    def __reduce__(self):
        return _arrive, (reduction.DupFd(self.fd),)


def _arrive(handle) -> Memory:
    memory = Memory.__new__(Memory)
    memory.fd = handle.detach()
    return memory


class Ring:
    """The last `depth` records that one process pushed, for any number of readers. Nobody ever waits.

    A record is copied out whole or not at all: its number is cleared while it is written, and a checksum catches what a
    processor that reorders memory accesses would let through.
    """

    _COUNT = 64

    def __init__(self, memory: np.ndarray, dtype: np.dtype, depth: int) -> None:
        """Lay the ring over memory [Ring.size(dtype, depth)], bytes; keeps what it holds."""
        self.dtype, self.depth = dtype, depth
        self._count = memory[: self._COUNT].view("<u8")
        heads_end = self._COUNT + 16 * depth
        self._heads = memory[self._COUNT : heads_end].view([("number", "<u8"), ("check", "<u8")])
        self._bytes = memory[heads_end : heads_end + depth * dtype.itemsize].reshape(depth, dtype.itemsize)

    @classmethod
    def size(cls, dtype: np.dtype, depth: int) -> int:
        """Bytes that a ring needs."""
        return -(-(cls._COUNT + depth * (16 + dtype.itemsize)) // 64) * 64

    @property
    def count(self) -> int:
        """Records ever pushed; the newest has number count - 1."""
        return int(self._count[0])

    def push(self, record: np.ndarray) -> None:
        """Append one record (zero-dimensional array of `dtype`), over the oldest one. One writer only."""
        number = self.count
        head, raw = self._heads[number % self.depth], record.tobytes()
        head["number"] = 0
        self._bytes[number % self.depth] = np.frombuffer(raw, np.uint8)
        head["check"] = zlib.crc32(raw)
        head["number"] = number + 1
        self._count[0] = number + 1

    def newest(self) -> np.void | None:
        """A copy of the newest record; None before the first one."""
        while number := self.count:
            record = self._copy(number - 1)
            if record is not None:
                return record
        return None

    def since(self, number: int) -> tuple[list[np.void], int]:
        """Copies of the records from `number` on, and how many of them are lost because the reader came too late."""
        count = self.count
        first = max(number, count - self.depth)
        copies = [self._copy(i) for i in range(first, count)]
        records = [record for record in copies if record is not None]
        return records, count - number - len(records)

    def column(self, name: str) -> np.ndarray:
        """One field of the records held, oldest first; for statistics: one being written may be half new."""
        count = self.count
        order = np.arange(max(0, count - self.depth), count) % self.depth
        return self._bytes.view(self.dtype)[:, 0][name][order]

    def _copy(self, number: int) -> np.void | None:
        head, place = self._heads[number % self.depth], self._bytes[number % self.depth]
        raw = place.copy()
        whole = head["number"] == number + 1 and head["check"] == zlib.crc32(raw.tobytes())
        return raw.view(self.dtype)[0] if whole else None


class Exchange:
    """The three rings between the two processes."""

    def __init__(self, memory: Memory, layout: Layout) -> None:
        rings = ((COMMAND, 8), (snapshot_dtype(layout.nq, layout.upper), 512), (layout.row, 1024))
        ends = np.cumsum([0, *(Ring.size(*ring) for ring in rings)])
        whole = memory.map(int(ends[-1]))
        parts = [Ring(whole[a:b], *ring) for a, b, ring in zip(ends[:-1], ends[1:], rings, strict=True)]
        self.commands, self.snapshots, self.rows = parts
        """Written by the web process, the simulation, the simulation. Depths: 8 commands; about 10 s; about 20 s."""
