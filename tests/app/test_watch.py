"""Whatever happens, somebody looks after the program."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from small_rows import DTYPE, METADATA, PACKED_MODEL
from stand_ins import eventually

from app.outputs.recorder import Recorder
from app.shared import Ring
from app.watch import Watch

GOOD = SimpleNamespace(state="STOPPED", reason="", driver=None, ticks=1)


@contextmanager
def watched(folder: Path, health=lambda: GOOD, lost=lambda: False) -> Iterator[Recorder]:
    recorder = Recorder(folder, lambda: (METADATA, PACKED_MODEL), Ring(np.zeros(Ring.size(DTYPE, 8), np.uint8), DTYPE, 8))
    watch = Watch(health, lost, recorder)
    yield recorder
    watch.close()
    recorder.close()


def test_the_recording_of_a_lost_simulation_is_closed(tmp_path: Path) -> None:
    lost = []
    with watched(tmp_path, lost=lambda: lost) as recorder:
        recorder.stop(recorder.start())
        recorder.start()
        lost.append(True)
        eventually(lambda: recorder.status().open is None)
        assert [info.ended for info in recorder.session()[1]] == ["stopped", "stopped"]


def test_a_simulation_that_pauses_for_a_moment_keeps_its_recording(tmp_path: Path) -> None:
    lost, looks = [True], []
    with watched(tmp_path, lost=lambda: looks.append(1) or lost) as recorder:
        recorder.start()
        eventually(lambda: len(looks) > 4)
        lost.clear()
        looks.clear()
        eventually(lambda: len(looks) > 10)
        assert recorder.status().open


def test_an_error_does_not_end_it(tmp_path: Path, caplog) -> None:
    asked, lost = [], []

    def health() -> SimpleNamespace:
        asked.append(1)
        raise RuntimeError("on purpose")

    with watched(tmp_path, health, lambda: lost) as recorder:
        eventually(lambda: len(asked) > 1)
        recorder.start()
        lost.append(True)
        eventually(lambda: recorder.status().open is None)
    assert "on purpose" in caplog.text
