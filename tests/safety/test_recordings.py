"""Nothing recorded is lost: full disks, kills, load."""

from __future__ import annotations

import multiprocessing
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from program import Program, operator
from small_rows import METADATA, PACKED_MODEL, make_rows
from stand_ins import eventually

from app.outputs.recorder import Recorder
from app.shared import Memory, Ring
from policies.episode import Metadata, row_dtype
from policies.recording.reader import Recording
from policies.recording.rewrite import recover

ROW = row_dtype(nu=41, nstate=200, nobs=400, nlatent=64, naction=13)
"""About what an H1 writes."""
DEPTH = 1024


@pytest.fixture
def small_disk(tmp_path: Path, program: Program) -> Iterator[Path]:
    """A file system of its own with 512 KiB beyond what a recording's model takes."""
    with program.recorded():
        time.sleep(0.1)
    with Recording(next(program.recordings.glob("*.mcap"))) as recording:
        model = len(recording.packed_model() or b"")
    folder = tmp_path / "disk"
    folder.mkdir()
    size = (model // 4096 + 1) * 4096 + 512 * 1024
    if subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", folder], capture_output=True).returncode:
        pytest.skip("only root may mount a small disk; tests/app/test_recorder.py fills one another way")
    yield folder
    subprocess.run(["umount", "-l", folder], check=True)


@pytest.mark.slow
@pytest.mark.row(12)
def test_a_full_disk_ends_the_episode_and_nothing_else(small_disk: Path, tmp_path: Path, measured) -> None:
    program = Program(small_disk)
    try:
        with operator(program) as driver:
            driver.engage()
            id = program.ask("POST", "/api/episodes", {"label": "full"})["id"]
            before, sizes = program.health, [(time.monotonic(), 0)]
            while (health := program.health)["recording_alarm"] is None:
                assert time.monotonic() - sizes[0][0] < 90, "512 KiB must be full by now"
                size = sum(file.stat().st_size for file in small_disk.iterdir())
                if size > sizes[-1][1]:
                    sizes.append((time.monotonic(), size))
                time.sleep(0.02)
            alarm = time.monotonic() - sizes[-1][0]
            time.sleep(1.0)
            after = program.health
        assert id in health["recording_alarm"]
        assert alarm <= 1.0
        assert after["ticks"] - before["ticks"] > 50
        assert after["upright"]
        missed = after["missed"] - before["missed"]
        assert missed <= 0.02 * (after["ticks"] - before["ticks"])
        (file,) = small_disk.glob("*.mcap")
        saved = tmp_path / file.name
        shutil.copy(file, saved)
    finally:
        program.close()
    recover(saved)
    with Recording(saved) as recording:
        (episode,) = recording.episodes()
    ticks = episode.rows["tick"].astype(int)
    assert (episode.info.ended, episode.info.gaps) == ("truncated", 0)
    assert np.array_equal(np.diff(ticks), np.ones(len(ticks) - 1))
    told = f"all on disk, alarm {1e3 * alarm:.0f} ms after the last write; {missed} ticks missed, upright"
    measured(12, f"512 KiB left: full after {len(ticks)} rows, {told}")


def killed(folder: Path, seconds: float) -> float:
    """Record in a process, kill it after some time: how much is lost when it is recovered [s]."""
    script = Path(__file__).parents[1] / "app" / "record_until_killed.py"
    with subprocess.Popen([sys.executable, script, folder], stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        tick_0 = float(program.stdout.readline())
        time.sleep(seconds)
        at = time.monotonic()
        program.send_signal(signal.SIGKILL)
    (path,) = folder.glob("*.mcap")
    recover(path)
    with Recording(path) as recording:
        (episode,) = recording.episodes()
    rows = episode.rows
    assert rows.tobytes() == make_rows(rows["tick"].tolist()).tobytes(), "bit for bit"
    kept = rows["tick"].astype(int).tolist()
    assert kept == list(range(kept[0], kept[-1] + 1)) if kept else not episode.info.rows
    return at - (tick_0 + (kept[-1] + 1 if kept else 0) / 50)


@pytest.mark.slow
@pytest.mark.row(13)
def test_fifty_kills_lose_half_a_second_each_at_most(measured) -> None:
    memory = Path("/dev/shm")  # a kill does not reach what the kernel holds, and other disks of a test machine may hang
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as folder, ThreadPoolExecutor(3) as pool:
        dice = random.Random(13)
        losses = list(pool.map(killed, [Path(folder, str(i)) for i in range(50)], [dice.uniform(0.2, 2.5) for _ in range(50)]))
    assert max(losses) <= 0.5
    median, most = 1e3 * np.median(losses), 1e3 * max(losses)
    measured(13, f"50 of 50 kills recovered bit for bit; lost {median:.0f} ms (median), {most:.0f} ms at most")


def _produce(memory: Memory, count: int, rate: float) -> None:
    """A simulation's rows at so many a second."""
    ring = Ring(memory.map(Ring.size(ROW, DEPTH)), ROW, DEPTH)
    noise = np.random.default_rng(0).normal(size=(64, ROW.itemsize // 8))
    row, began = np.zeros((), ROW), time.monotonic()
    for tick in range(count):
        row["state"] = noise[tick % 64][: row["state"].size]
        row["tick"], row["time"], row["jump"] = tick, tick / 50, tick == 0
        ring.push(row)
        time.sleep(max(0.0, began + (tick + 1) / rate - time.monotonic()))


@pytest.mark.row(14)
@pytest.mark.parametrize("count", [1500, pytest.param(30_000, marks=pytest.mark.slow)])
def test_every_row_reaches_the_disk_under_load(tmp_path: Path, count: int, measured) -> None:
    memory, rate = Memory(), 500.0
    ring = Ring(memory.map(Ring.size(ROW, DEPTH)), ROW, DEPTH)
    metadata = Metadata(robot="x", policy="x", dtype=ROW, nq=48, nv=47, substeps=4, rate=50.0, reasons=METADATA.reasons)
    recorder, working = Recorder(tmp_path, lambda: (metadata, PACKED_MODEL), ring), threading.Event()

    def work() -> None:
        while not working.is_set():
            sum(range(20_000))  # a web process that is busy

    busy = threading.Thread(target=work)
    busy.start()
    try:
        id = recorder.start("load")
        producer = multiprocessing.get_context("spawn").Process(target=_produce, args=(memory, count, rate))
        producer.start()
        producer.join()
        eventually(lambda: (info := recorder.status().open) is not None and info.rows + info.missing == count, 30)
        info = recorder.stop(id)
    finally:
        working.set()
        busy.join()
        recorder.close()
    assert (info.rows, info.gaps, info.missing) == (count, 0, 0)
    with Recording(info.file) as recording:
        (episode,) = recording.episodes()
    assert np.array_equal(episode.rows["tick"], np.arange(count))
    megabytes = os.stat(info.file).st_size / 1e6
    measured(14, f"{info.rows} of {count} rows at {rate:.0f} a second beside a busy thread; {megabytes:.1f} MB")
