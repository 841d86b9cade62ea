"""Shared memory: the newest record wins, a reader never sees half of one, nothing keeps a name on the machine."""

from __future__ import annotations

import multiprocessing
from pathlib import Path

import numpy as np
import pytest

from app.shared import Exchange, Layout, Memory, Ring
from policies.episode import row_dtype

NUMBERS = np.dtype([("tick", "<u8"), ("values", "<f8", (200,))])
LAYOUT = Layout(nq=7, upper=3, row=row_dtype(3, 20, 5, 4, 3))


def ring(memory: Memory, depth: int = 4) -> Ring:
    return Ring(memory.map(Ring.size(NUMBERS, depth)), NUMBERS, depth)


def record(number: int) -> np.ndarray:
    made = np.zeros((), NUMBERS)
    made["tick"], made["values"] = number, number
    return made


def test_the_newest_record_wins_and_a_slow_reader_is_told_what_it_lost() -> None:
    memory = Memory()
    written, read = ring(memory), ring(memory)
    assert read.newest() is None
    for number in range(11):
        written.push(record(number))
    assert read.newest()["tick"] == 10
    records, lost = read.since(2)
    assert [int(r["tick"]) for r in records] == [7, 8, 9, 10]
    assert lost == 5
    assert read.since(11) == ([], 0)
    assert read.column("tick").tolist() == [7, 8, 9, 10]


def test_a_record_that_is_being_overwritten_is_not_read() -> None:
    memory = Memory()
    written, read = ring(memory), ring(memory)
    for number in range(4):
        written.push(record(number))
    read._bytes[1][8:16] = 255  # as a writer would leave it half way
    records, lost = read.since(0)
    assert [int(r["tick"]) for r in records] == [0, 2, 3]
    assert lost == 1


def _write_many(memory: Memory) -> None:
    target = ring(memory)
    for number in range(20_000):
        target.push(record(number))


def test_readers_beside_a_writing_process_only_see_whole_records() -> None:
    memory = Memory()
    read = ring(memory)
    writer = multiprocessing.get_context("spawn").Process(target=_write_many, args=(memory,))
    writer.start()
    seen = set()
    while writer.is_alive():
        newest = read.newest()
        if newest is not None:
            assert np.all(newest["values"] == newest["tick"])
            seen.add(int(newest["tick"]))
    assert len(seen) > 10
    assert read.newest()["tick"] == 19_999


@pytest.mark.skipif(not Path("/dev/shm").is_dir(), reason="only where shared memory has names in /dev/shm")
def test_nothing_appears_under_dev_shm() -> None:
    before = set(Path("/dev/shm").iterdir())
    exchange = Exchange(Memory(), LAYOUT)
    exchange.rows.push(np.zeros((), LAYOUT.row))
    assert not [path for path in set(Path("/dev/shm").iterdir()) - before if "teleop" in path.name]


def test_both_sides_of_an_exchange_lay_it_out_alike() -> None:
    memory = Memory()
    ours, theirs = Exchange(memory, LAYOUT), Exchange(memory, LAYOUT)
    row = np.zeros((), LAYOUT.row)
    row["tick"], row["ctrl"] = 5, [1, 2, 3]
    theirs.rows.push(row)
    theirs.snapshots.push(np.ones((), theirs.snapshots.dtype))
    assert ours.rows.newest()["ctrl"].tolist() == [1, 2, 3]
    assert ours.snapshots.newest()["tick"] == 1
    assert ours.commands.newest() is None
