"""What a row and its metadata promise to whoever reads a file years later."""

import json

import numpy as np
import pytest

from policies.command import COMMAND_LAYOUT, SIZE, Command
from policies.episode import Metadata, holes, missing_ticks, row_dtype


def metadata() -> Metadata:
    dtype = row_dtype(nu=41, nstate=633, nobs=98, nlatent=64, naction=12)
    return Metadata("h1", "walk", dtype, nq=60, nv=59, substeps=4, rate=50.0, reasons=("a", "b"), versions={"numpy": "2"})


def test_a_row_is_packed_and_little_endian():
    dtype = metadata().dtype
    assert dtype.itemsize == 8 * (3 + 633 + 41 + 2 * SIZE) + 4 * (98 + 64 + 12 + 6) + 4
    assert all(kind[0] in "<|" for _, kind, *_ in dtype.descr)


def test_the_command_layout_names_every_number_of_a_command():
    numbers = np.arange(1.0, SIZE + 1)
    command = Command.from_vector(numbers)
    for name, (start, stop) in COMMAND_LAYOUT.items():
        if name != "engage":
            assert np.array_equal(np.ravel(getattr(command, name)), numbers[start:stop]), name
    assert sorted(i for start, stop in COMMAND_LAYOUT.values() for i in range(start, stop)) == list(range(SIZE))


def test_metadata_survives_json():
    assert Metadata.from_json(json.loads(json.dumps(metadata().to_json()))) == metadata()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"format": 1}, "format 1"),
        ({"dtype": [["tick", "<u8"]]}, "incomplete"),
        ({"dtype": [*metadata().dtype.descr, ("extra", "<f8")]}, "unknown layout"),
        ({"dtype": 7}, "incomplete"),
    ],
)
def test_metadata_of_another_kind_is_refused(change: dict, sentence: str):
    with pytest.raises(ValueError, match=sentence):
        Metadata.from_json(metadata().to_json() | change)


def test_holes_are_where_ticks_do_not_go_up_by_one():
    ticks = np.array([5, 6, 9, 10, 2, 3], dtype=np.uint64)
    assert holes(ticks) == [(6, 9), (10, 2)]
    assert holes(ticks, previous=3) == [(3, 5), (6, 9), (10, 2)]
    assert missing_ticks(ticks, previous=3) == (3, 1 + 2)
    assert holes(np.array([], dtype=np.uint64), previous=3) == []
