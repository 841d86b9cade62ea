"""Looks after a running program: tells the log how it goes, and closes the recording of a simulation that is lost."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from app import clock
from app.outputs.recorder import Recorder
from app.outputs.tape import RecordingError
from app.protocol import Health

_log = logging.getLogger(__name__)

PERIOD = 0.1
"""How often it looks [s]."""
PATIENCE = 1.0
"""A simulation that is lost for so long ends the recording [s]. A shorter stall costs no rows: the ring holds them."""
LATENCY_PERIOD = 10.0
"""How often the latency of every stage is logged while somebody drives [s]."""


class Watch:
    """A thread that nothing but `close` ends."""

    def __init__(self, health: Callable[[], Health], lost: Callable[[], bool], recorder: Recorder) -> None:
        """Start to look. `lost` tells whether the simulation is dead or hangs."""
        self._health, self._lost, self._recorder = health, lost, recorder
        self._told, self._state = clock.now(), ""
        self._alive = clock.now()
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, name="watch", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Look no more."""
        self._ends.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._ends.wait(PERIOD):
            for look in (self._save, self._tell):
                try:
                    look()
                except Exception:
                    _log.exception("looking after the robot failed")

    def _save(self) -> None:
        """The recording of a simulation that is lost."""
        if not self._lost():
            self._alive = clock.now()
        recording = self._recorder.status().open
        if recording and clock.now() - self._alive > PATIENCE:
            try:
                self._recorder.stop(recording.id)
            except RecordingError as error:
                _log.error("%s", error)

    def _tell(self) -> None:
        """What becomes of the robot and of the latencies."""
        now = self._health()
        if now.state != self._state:
            self._state = now.state
            _log.info("state", extra={"state": now.state, "reason": now.reason, "driver": now.driver, "tick": now.ticks})
        if now.driver and clock.now() - self._told > LATENCY_PERIOD:
            self._told = clock.now()
            _log.info("latency", extra={"latency_ms": now.latency_ms.model_dump(), "filter_ms": now.filter_ms})
