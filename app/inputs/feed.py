"""Lets a source of this program speak, among the operators."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from app import clock
from app.arbiter import Role
from app.inputs.operator import Operators
from app.inputs.source import Source
from policies.command import Command

PERIOD = 0.02
"""Seconds between two messages."""

_log = logging.getLogger(__name__)


class Feed:
    """One source on a thread of its own, a client like every other. It presses Engage once, at its start."""

    def __init__(self, source: Source, operators: Operators, applied: Callable[[], Command]) -> None:
        """Start to speak. `applied` tells what the robot does now."""
        self._source, self._operators, self._applied = source, operators, applied
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._speak, name=source.name, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Fall silent; what it drove holds."""
        self._ends.set()
        self._thread.join()

    def _speak(self) -> None:
        client, began, seq = self._operators.join(), clock.now(), 0
        client.name = self._source.name
        try:
            while not self._ends.wait(PERIOD if seq else 0):
                taken: list[Role] = [role for role, driver in self._operators.drivers.items() if driver not in (client, None)]
                message = self._source.message(seq, clock.now() - began if seq else 0.0, self._applied(), taken)
                if message is None:
                    return
                self._operators.hear(client, message)
                seq += 1
        except Exception:
            _log.exception("the source %s failed", self._source.name)
        finally:
            self._operators.leave(client)
