"""Every row of an open episode reaches the disk, whatever happens to the program, the disk or the ring."""

import random
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_rows import DTYPE, METADATA, PACKED_MODEL, make_rows

from app.outputs.recorder import PUMP_PERIOD, Recorder
from app.outputs.tape import DiskFailed, Tape, WrongMoment
from app.shared import Ring
from policies.recording.library import Library
from policies.recording.reader import Recording
from policies.recording.rewrite import recover
from policies.recording.session_file import SessionFile

DEPTH = 256


class Simulation:
    """Pushes rows into a ring when it is told to."""

    def __init__(self) -> None:
        self.ring = Ring(np.zeros(Ring.size(DTYPE, DEPTH), np.uint8), DTYPE, DEPTH)

    def run(self, ticks: int) -> np.ndarray:
        rows = make_rows(range(self.ring.count, self.ring.count + ticks))
        for row in rows:
            self.ring.push(np.array(row))
        return rows


@pytest.fixture
def simulation() -> Simulation:
    return Simulation()


@pytest.fixture
def tape(tmp_path: Path, simulation: Simulation) -> Tape:
    return Tape(tmp_path, lambda: (METADATA, PACKED_MODEL), simulation.ring)


@pytest.fixture
def recorder(tmp_path: Path, simulation: Simulation) -> Iterator[Recorder]:
    recorder = Recorder(tmp_path, lambda: (METADATA, PACKED_MODEL), simulation.ring)
    yield recorder
    recorder.close()


def rows_of(path: Path, number: int) -> np.ndarray:
    with Recording(path) as recording:
        return recording.episode(next(info for info in recording.infos if info.number == number)).rows


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 10
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


@pytest.fixture
def full_disk() -> Iterator[Callable[[int], None]]:
    """Call it with the largest size a file may have from now on [bytes]."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_an_episode_has_exactly_the_rows_between_start_and_stop(tape: Tape, simulation: Simulation):
    simulation.run(20)
    tape.pump()
    first = tape.start("one")
    expected = simulation.run(30)
    tape.pump()
    more = simulation.run(7)
    tape.pump()
    tape.stop(first, "stopped", success=True)
    simulation.run(5)
    tape.pump()
    second = tape.start("two")
    other = simulation.run(3)
    tape.pump()
    tape.stop(second, "stopped")
    assert tape.path is not None
    assert rows_of(tape.path, 1).tobytes() == np.concatenate([expected, more]).tobytes()
    assert rows_of(tape.path, 2).tobytes() == other.tobytes()
    assert [info.label for info in tape.done] == ["one", "two"]


def test_nothing_is_written_before_the_first_episode(tape: Tape, simulation: Simulation):
    simulation.run(10)
    tape.pump()
    assert list(tape.directory.iterdir()) == []


@pytest.mark.row(14)
def test_a_ring_that_overran_is_a_counted_gap(tape: Tape, simulation: Simulation):
    episode = tape.start("")
    simulation.run(10)
    tape.pump()
    simulation.run(DEPTH + 25)
    tape.pump()
    info = tape.stop(episode, "stopped")
    assert (info.rows, info.gaps, info.missing) == (10 + DEPTH, 1, 25)


def test_orders_at_the_wrong_moment(tape: Tape):
    with pytest.raises(WrongMoment, match="not being recorded"):
        tape.stop("nothing", "stopped")
    episode = tape.start("")
    with pytest.raises(WrongMoment, match=episode):
        tape.start("")
    with pytest.raises(WrongMoment):
        tape.release()
    tape.stop(episode, "stopped")
    with pytest.raises(WrongMoment):
        tape.stop(episode, "stopped")


def test_another_policy_gets_another_file(tmp_path: Path, simulation: Simulation):
    metadata = METADATA
    tape = Tape(tmp_path, lambda: (metadata, PACKED_MODEL), simulation.ring)
    tape.stop(tape.start(""), "stopped")
    first = tape.path
    metadata = replace(METADATA, policy="other")
    tape.stop(tape.start(""), "stopped")
    assert tape.path != first
    assert first is not None
    with Recording(first) as recording:
        assert recording.finished
        assert recording.metadata.policy == "none"


def test_a_discarded_episode_is_hidden_and_dropped(tape: Tape, simulation: Simulation):
    kept = tape.start("")
    tape.stop(kept, "stopped")
    gone = tape.start("")
    simulation.run(40)
    tape.pump()
    tape.discard(gone)
    assert [info.id for info in tape.done] == [kept]
    path = tape.path
    tape.release()
    library = Library(tape.directory)
    assert [info.id for info in library.infos()] == [kept]
    assert path is not None
    size = path.stat().st_size
    library.tidy()
    assert path.stat().st_size < size


@pytest.mark.row(12)
def test_a_full_disk_truncates_the_episode_and_loses_no_flushed_row(tape: Tape, simulation: Simulation, full_disk: Callable[[int], None]):
    episode = tape.start("big")
    path = tape.path
    assert path is not None
    flushed = simulation.run(50)
    tape.pump()
    full_disk(path.stat().st_size + 2000)
    simulation.run(50)
    tape.pump()
    assert tape.open is None
    assert tape.alarm is not None
    assert episode in tape.alarm
    with pytest.raises(DiskFailed, match="truncated"):
        tape.stop(episode, "stopped")
    full_disk(100)
    with pytest.raises(DiskFailed, match="could not be started"):
        tape.start("still full")
    full_disk(1 << 30)
    again = tape.start("room again")
    assert tape.alarm is None
    tape.stop(again, "stopped")
    infos = {info.label: info for info in Library(tape.directory).infos()}
    assert infos["big"].ended == "truncated"
    assert rows_of(path, 1)[:50].tobytes() == flushed.tobytes()
    assert infos["room again"].ended == "stopped"


@pytest.mark.row(12)
def test_a_slow_disk_raises_the_alarm_and_loses_no_row(recorder: Recorder, simulation: Simulation, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("app.outputs.recorder.SLOW_DISK", 0.1)
    hangs, flush = threading.Event(), SessionFile.flush

    def slow(self: SessionFile) -> None:
        hangs.wait(10)
        flush(self)

    episode = recorder.start()
    monkeypatch.setattr(SessionFile, "flush", slow)
    simulation.run(DEPTH // 2)
    until(lambda: recorder.status().alarm is not None)
    assert "slow" in str(recorder.status().alarm)
    simulation.run(DEPTH // 2)
    hangs.set()
    info = recorder.stop(episode)
    assert recorder.status().alarm is None
    assert (info.rows, info.gaps) == (DEPTH, 0)


def test_status_follows_the_episode(recorder: Recorder, simulation: Simulation):
    assert recorder.status().open is None
    episode = recorder.start("watched")
    simulation.run(25)
    until(lambda: (info := recorder.status().open) is not None and info.rows == 25)
    info = recorder.status().open
    assert info is not None
    assert (info.id, info.label, info.seconds, info.ended) == (episode, "watched", 0.5, "open")
    stopped = recorder.stop(episode, label="renamed", success=False)
    assert (stopped.label, stopped.success, stopped.ended) == ("renamed", False, "stopped")
    assert recorder.status().open is None


def test_closing_completes_an_open_episode(tmp_path: Path, simulation: Simulation):
    recorder = Recorder(tmp_path, lambda: (METADATA, PACKED_MODEL), simulation.ring)
    recorder.start("left open")
    expected = simulation.run(12)
    recorder.close()
    (info,) = Library(tmp_path).infos()
    assert (info.ended, info.rows) == ("closed", 12)
    assert rows_of(info.file, 1).tobytes() == expected.tobytes()
    with Recording(info.file) as recording:
        assert recording.finished
    with pytest.raises(WrongMoment):
        recorder.start()


def test_no_row_is_lost_at_many_times_the_real_rate(recorder: Recorder, simulation: Simulation):
    episode = recorder.start()
    rows = []
    for _ in range(16):
        rows.append(simulation.run(DEPTH // 4))
        time.sleep(PUMP_PERIOD)
    info = recorder.stop(episode)
    assert (info.rows, info.gaps) == (16 * DEPTH // 4, 0)
    assert rows_of(info.file, 1).tobytes() == np.concatenate(rows).tobytes()


@pytest.fixture
def quick_disk(tmp_path: Path) -> Iterator[Path]:
    """A folder in memory where there is one: this machine's disk may hang for longer than a test can wait."""
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else tmp_path) as folder:
        yield Path(folder)


@pytest.mark.row(13)
def test_a_kill_loses_half_a_second_at_most(quick_disk: Path):
    script = Path(__file__).with_name("record_until_killed.py")
    folders = [quick_disk / str(i) for i in range(3)]
    programs = [subprocess.Popen([sys.executable, script, folder], stdout=subprocess.PIPE, text=True) for folder in folders]
    for program, folder in zip(programs, folders, strict=True):
        assert program.stdout is not None
        tick_0 = float(program.stdout.readline())
        time.sleep(random.uniform(0.6, 1.8))
        killed = time.monotonic()
        program.send_signal(signal.SIGKILL)
        program.wait()
        program.stdout.close()
        (path,) = Library(folder).files()
        assert recover(path).changed
        rows = rows_of(path, 1)
        assert rows.tobytes() == make_rows(rows["tick"].tolist()).tobytes()
        assert np.array_equal(np.diff(rows["tick"].astype(int)), np.ones(len(rows) - 1))
        assert killed - (tick_0 + (int(rows["tick"][-1]) + 1) / 50) <= 0.5
