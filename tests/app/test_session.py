"""The program put together, with a robot that hangs."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from stand_ins import Hanging, eventually

from app import session as sessions
from app.config import Serve
from app.session import Session


@pytest.fixture
def session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Session]:
    monkeypatch.setattr(sessions, "Factory", lambda *_: Hanging())
    running = Session(Serve(recordings=tmp_path))
    yield running
    running.close()


def test_a_simulation_that_hangs_starts_again_where_the_seed_says_and_recordings_know(session: Session) -> None:
    session.episodes.start("before")
    assert session.simulation.pid
    os.kill(session.simulation.pid, signal.SIGSTOP)
    eventually(lambda: session.episodes.recorder.status().open is None)
    session.reset(seed=5)
    eventually(lambda: abs(session.health().base.yaw) > 0.01)
    session.episodes.start("after")
    told = {info.label: (info.seed, info.ended) for info in session.episodes.infos()}
    assert told == {"before": (0, "stopped"), "after": (5, "open")}
