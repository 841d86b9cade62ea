"""Files hold what was written, and give back all that a crash or damage left intact."""

import contextlib
import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from small_rows import METADATA, MODEL, PACKED_MODEL, START, make_rows

from policies.episode import DamagedRecording, EpisodeInfo, Metadata
from policies.recording.container import survey
from policies.recording.library import Library
from policies.recording.reader import Recording
from policies.recording.rewrite import RecordingInUse, keep_only, recover
from policies.recording.session_file import SessionFile
from policies.recording.writer import EpisodeWriter

TICKS = {1: range(60), 2: range(100, 140), 3: range(200, 230)}
BLOCK = 10
EPISODES = {number: make_rows(ticks) for number, ticks in TICKS.items()}


def write(output, finish: bool = True, metadata: Metadata = METADATA) -> list[tuple[int, int]]:
    """Three episodes, flushed every BLOCK rows. Returns (file size, rows written) after each flush."""
    writer, flushes, count = EpisodeWriter(output, metadata, PACKED_MODEL), [], 0
    for number, rows in EPISODES.items():
        writer.begin(EpisodeInfo(f"e{number}", number, Path(), START + number, label=f"label {number}"))
        for i in range(0, len(rows), BLOCK):
            writer.rows(rows[i : i + BLOCK])
            writer.flush()
            count += len(rows[i : i + BLOCK])
            flushes.append((output.tell(), count))
        writer.end(START + number + 9, success=number != 2)
    if finish:
        writer.finish()
    return flushes


def content(finish: bool) -> tuple[bytes, list[tuple[int, int]]]:
    buffer = io.BytesIO()
    flushes = write(buffer, finish)
    return buffer.getvalue(), flushes


FINISHED, _ = content(True)
UNFINISHED, FLUSHES = content(False)
ALL = np.concatenate(list(EPISODES.values()))


@pytest.fixture(autouse=True, scope="module")
def _no_waiting_for_the_disk():
    """What a power cut does is not tested here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("os.fsync", lambda fd: None)
        yield


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "session.mcap"
    file.write_bytes(FINISHED)
    return file


def read(path: Path) -> dict[str, np.ndarray]:
    with Recording(path) as recording:
        return {episode.info.id: episode.rows for episode in recording.episodes()}


def ticks_read(path: Path) -> set[int]:
    """Ticks of all rows that come back; each row must be exactly the written one."""
    known = {int(row["tick"]): row.tobytes() for row in ALL}
    found = [row for rows in read(path).values() for row in rows]
    assert all(known[int(row["tick"])] == row.tobytes() for row in found)
    assert len({int(row["tick"]) for row in found}) == len(found)
    return {int(row["tick"]) for row in found}


@pytest.mark.parametrize("finish", [True, False])
def test_rows_labels_model_and_metadata_come_back_exactly(tmp_path: Path, finish: bool):
    path = tmp_path / "session.mcap"
    path.write_bytes(FINISHED if finish else UNFINISHED)
    with Recording(path) as recording:
        assert recording.finished is finish
        episodes = list(recording.episodes())
    assert [(e.info.id, e.info.label, e.info.success, e.info.ended) for e in episodes] == [
        ("e1", "label 1", True, "stopped"),
        ("e2", "label 2", False, "stopped"),
        ("e3", "label 3", True, "stopped"),
    ]
    for episode in episodes:
        assert episode.rows.tobytes() == EPISODES[episode.info.number].tobytes()
        assert episode.info.rows == len(episode.rows)
        assert (episode.metadata, episode.model) == (METADATA, MODEL)


def test_the_list_of_a_complete_file_is_the_list_of_its_rows(path: Path):
    with Recording(path) as listed, Recording(path, every_row=True) as counted:
        assert listed.infos == counted.infos


def test_other_programs_can_read_the_file(path: Path):
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        topics = [channel.topic for _, channel, _ in reader.iter_messages()]
        assert [a.name for a in reader.iter_attachments()] == ["model.mjb.zst"]
    assert summary is not None
    assert {c.topic: c.message_encoding for c in summary.channels.values()} == {
        "/episode": "json",
        "/row": "x-numpy-record",
        "/robot": "json",
    }
    assert topics.count("/row") == len(ALL)
    assert topics.count("/robot") == sum(tick % 5 == 0 for ticks in TICKS.values() for tick in ticks)


@settings(max_examples=30, deadline=None)
@given(cut=st.integers(0, len(UNFINISHED)))
def test_a_file_cut_anywhere_gives_back_every_flushed_row(tmp_path_factory, cut: int):
    path = tmp_path_factory.mktemp("cut") / "session.mcap"
    path.write_bytes(UNFINISHED[:cut])
    flushed = max((rows for size, rows in FLUSHES if size <= cut), default=0)
    try:
        found = ticks_read(path)
    except DamagedRecording:
        assert flushed == 0
        return
    assert found >= {int(row["tick"]) for row in ALL[:flushed]}
    recovered = recover(path)
    assert recovered.rows == len(found)
    assert ticks_read(path) == found
    with Recording(path) as recording:
        assert recording.finished


@settings(max_examples=40, deadline=None)
@given(data=st.data(), finish=st.booleans())
def test_a_flipped_bit_costs_the_rows_of_its_chunk_at_most(tmp_path_factory, data: st.DataObject, finish: bool):
    intact = FINISHED if finish else UNFINISHED
    at, bit = data.draw(st.integers(0, len(intact) - 1)), data.draw(st.integers(0, 7))
    path = tmp_path_factory.mktemp("flip") / "session.mcap"
    path.write_bytes(intact[:at] + bytes([intact[at] ^ 1 << bit]) + intact[at + 1 :])
    sizes = [0, *(size for size, _ in FLUSHES)]
    lost = next((i for i, size in enumerate(sizes[1:]) if size > at), None)
    hit = set() if lost is None else {int(row["tick"]) for row in ALL[lost * BLOCK : (lost + 1) * BLOCK]}
    everything = {int(row["tick"]) for row in ALL}
    assert ticks_read(path) >= everything - hit
    recover(path)
    assert ticks_read(path) >= everything - hit


@settings(max_examples=30, deadline=None)
@given(data=st.data())
def test_heavy_damage_never_raises_anything_else(tmp_path_factory, data: st.DataObject):
    broken = bytearray(FINISHED if data.draw(st.booleans()) else UNFINISHED)
    for start, junk in data.draw(st.lists(st.tuples(st.integers(0, len(broken) - 1), st.binary(min_size=1, max_size=64)), max_size=20)):
        broken[start : start + len(junk)] = junk
    path = tmp_path_factory.mktemp("junk") / "session.mcap"
    path.write_bytes(broken)
    with contextlib.suppress(DamagedRecording):
        found = ticks_read(path)
        assert recover(path).rows == len(found)


def test_what_recover_replaces_is_kept_when_something_was_damaged(path: Path):
    with path.open("rb") as file:
        chunk = survey(file).chunks[1].offset
    broken = bytearray(FINISHED)
    broken[chunk + 100] ^= 1
    path.write_bytes(broken)
    done = recover(path)
    assert (done.damaged, done.missing, done.rows) == (1, BLOCK, len(ALL) - BLOCK)
    assert done.original is not None
    assert done.original.read_bytes() == broken
    assert not recover(path).changed


def test_a_complete_file_is_left_alone(path: Path):
    assert not recover(path).changed
    assert path.read_bytes() == FINISHED


def test_a_crash_shows_as_a_truncated_episode(path: Path):
    path.write_bytes(UNFINISHED[: FLUSHES[2][0] + 100])
    assert recover(path).original is None
    with Recording(path) as recording:
        (info,) = recording.infos
    assert (info.id, info.ended, info.rows, info.label, info.success) == ("e1", "truncated", 3 * BLOCK, "label 1", None)


def test_gaps_are_counted_and_written(tmp_path: Path):
    path = tmp_path / "gaps.mcap"
    file = SessionFile(path)
    writer = EpisodeWriter(file, METADATA, None)
    writer.begin(EpisodeInfo("g", 1, path, START))
    writer.rows(make_rows([1, 2, 5, 6]))
    writer.rows(make_rows([10, 3]))
    info = writer.end(START)
    writer.finish()
    file.publish()
    file.close()
    assert (info.gaps, info.missing) == (3, 2 + 3)
    with Recording(path) as listed, Recording(path, every_row=True) as counted:
        assert (listed.infos[0].gaps, listed.infos[0].missing) == (3, 5)
        assert (counted.infos[0].gaps, counted.infos[0].missing) == (3, 5)
    with path.open("rb") as stream:
        events = [message.data for _, channel, message in make_reader(stream).iter_messages("/episode")]
    assert sum(b'"gap"' in event for event in events) == 3


@pytest.mark.parametrize(
    ("bytes_", "sentence"),
    [(b"", "no readable episode"), (b"not a recording" * 100, "no readable episode"), (FINISHED[:60], "no readable episode")],
)
def test_a_foreign_file_is_refused_in_one_sentence(tmp_path: Path, bytes_: bytes, sentence: str):
    path = tmp_path / "foreign.mcap"
    path.write_bytes(bytes_)
    with pytest.raises(DamagedRecording, match=sentence) as caught:
        Recording(path)
    assert "\n" not in str(caught.value)


def test_another_format_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = tmp_path / "future.mcap"
    with monkeypatch.context() as patch, path.open("wb") as file:
        patch.setattr("policies.episode.FORMAT", 99)
        write(file)
    with pytest.raises(DamagedRecording, match="format 99"):
        Recording(path)


def test_a_file_being_written_is_not_touched(tmp_path: Path):
    path = tmp_path / "live.mcap"
    file = SessionFile(path)
    write(file, finish=False)
    file.publish()
    before = path.read_bytes()
    with pytest.raises(RecordingInUse):
        recover(path)
    library = Library(tmp_path)
    assert library.tidy() == []
    assert path.read_bytes() == before
    assert len(library.infos()) == 3
    file.close()
    assert [done.path for done in library.tidy()] == [path]


def test_a_file_appears_only_whole(tmp_path: Path):
    path = tmp_path / "late.mcap"
    file = SessionFile(path)
    write(file)
    file.flush()
    assert Library(tmp_path).files() == []
    file.close()
    assert list(tmp_path.iterdir()) == []


def test_deleting_gives_the_space_back(path: Path):
    library = Library(path.parent)
    first, second, third = sorted(library.infos(), key=lambda info: info.number)
    library.delete(second)
    assert path.stat().st_size < len(FINISHED)
    assert [info.id for info in library.infos()] == ["e3", "e1"]
    assert read(path)["e3"].tobytes() == EPISODES[3].tobytes()
    library.delete(first)
    library.delete(third)
    assert not path.exists()


def test_a_discarded_episode_is_gone_and_its_space_returns(tmp_path: Path):
    path = tmp_path / "session.mcap"
    file = SessionFile(path)
    write(file, finish=False)
    file.publish()
    file.close()
    with path.open("ab") as stream:  # a later chunk of the same session
        buffer = io.BytesIO()
        writer = EpisodeWriter(buffer, METADATA, None)
        writer.flush()
        start = buffer.tell()
        writer.discard(2, START)
        stream.write(buffer.getvalue()[start:])
    library = Library(tmp_path)
    assert [info.id for info in library.infos()] == ["e3", "e1"]
    size = path.stat().st_size
    library.tidy()
    assert path.stat().st_size < size
    assert set(read(path)) == {"e1", "e3"}


def test_a_full_disk_leaves_the_file_as_it_was(path: Path, monkeypatch: pytest.MonkeyPatch):
    def full(self: SessionFile) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(SessionFile, "flush", full)
    with pytest.raises(OSError, match="No space"):
        keep_only(path, {1})
    assert path.read_bytes() == FINISHED
    assert list(path.parent.iterdir()) == [path]


def test_frames_are_every_second_qpos(path: Path):
    library = Library(path.parent)
    info = next(info for info in library.infos() if info.id == "e1")
    frames = library.frames(info)
    with np.errstate(over="ignore"):
        expected = METADATA.qpos(EPISODES[1])[::2].astype(np.float32)
    assert frames.dtype == np.float32
    assert np.array_equal(frames, expected, equal_nan=True)


def test_a_broken_file_does_not_hide_the_others(path: Path):
    other = path.with_name("broken.mcap")
    other.write_bytes(b"junk" * 10)
    library = Library(path.parent)
    assert len(library.infos()) == 3
    assert list(library.damaged) == [other]
