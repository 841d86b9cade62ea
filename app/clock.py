"""Time on this machine: absolute deadlines, and what each stage of a tick took."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import ParamSpec, TypeVar

import numpy as np

P = ParamSpec("P")
T = TypeVar("T")


def nanoseconds() -> int:
    """The monotonic clock, the same in every process of this machine."""
    return time.monotonic_ns()


def now() -> float:
    """The same in seconds."""
    return nanoseconds() * 1e-9


class Ticker:
    """Wakes once a period, at absolute deadlines. What is missed is skipped and counted, never caught up."""

    def __init__(self, period: float, clock: Callable[[], float] = now, sleep: Callable[[float], None] = time.sleep) -> None:
        """The first deadline is one period [s] away."""
        self.period, self._clock, self._sleep = period, clock, sleep
        self.deadline = clock() + period
        self.missed = 0

    def wait(self) -> float:
        """Sleep until the next deadline. Returns how late it woke [s]."""
        late_by = self._clock() - self.deadline
        if late_by > self.period:
            skipped = int(late_by / self.period)
            self.missed += skipped
            self.deadline += skipped * self.period
        self._sleep(max(0.0, self.deadline - self._clock()))
        lateness = self._clock() - self.deadline
        self.deadline += self.period
        return lateness


class Laps:
    """What the stages of a tick take."""

    def __init__(self) -> None:
        self.start = now()
        """When this tick began, monotonic [s]."""
        self._ms: dict[str, float] = dict.fromkeys(("queue", "act", "physics", "publish", "lateness"), 0.0)
        self._serial = 0

    def restart(self, lateness: float) -> None:
        """A tick begins, `lateness` after its deadline [s]."""
        self.start = now()
        self._ms["lateness"] = lateness * 1e3

    def time(self, stage: str, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Call the function and keep how long it took."""
        started = now()
        result = function(*args, **kwargs)
        self._ms[stage] = (now() - started) * 1e3
        return result

    def latency(self, serial: int, stamp: float, ik_ms: float) -> tuple[float, ...]:
        """policies.episode.STAGES [ms]; `publish` is that of the tick before.

        Args:
            serial: of the command that this tick read; only a new one has waited.
            stamp: when the operator's message of that command arrived, monotonic [s].
            ik_ms: the part of `act` that was inverse kinematics.
        """
        if serial != self._serial and np.isfinite(stamp):
            self._ms["queue"] = (self.start - stamp) * 1e3
        self._serial = serial
        ms = self._ms
        return (ms["queue"], ik_ms, max(0.0, ms["act"] - ik_ms), ms["physics"], ms["publish"], ms["lateness"])
