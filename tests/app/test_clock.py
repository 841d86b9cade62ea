"""Absolute deadlines: no drift, no bursts."""

from __future__ import annotations

import pytest

from app.clock import Ticker


class FakeTime:
    """Sleeps take exactly what is asked, plus what a test adds."""

    def __init__(self) -> None:
        self.now, self.oversleep = 0.0, 0.0

    def sleep(self, seconds: float) -> None:
        self.now += seconds + self.oversleep


@pytest.fixture
def time() -> FakeTime:
    return FakeTime()


def ticker(time: FakeTime) -> Ticker:
    return Ticker(0.02, clock=lambda: time.now, sleep=time.sleep)


def test_late_wake_ups_are_told_and_do_not_add_up(time: FakeTime) -> None:
    ticks = ticker(time)
    time.oversleep = 0.003
    assert [ticks.wait() for _ in range(100)] == pytest.approx([0.003] * 100)
    assert time.now == pytest.approx(100 * 0.02 + 0.003)


def test_a_tick_that_runs_long_starts_the_next_one_at_once_and_keeps_the_beat(time: FakeTime) -> None:
    ticks = ticker(time)
    ticks.wait()
    time.now += 0.03
    assert ticks.wait() == pytest.approx(0.01)
    ticks.wait()
    assert time.now == pytest.approx(0.06)
    assert ticks.missed == 0


def test_missed_ticks_are_counted_and_never_caught_up(time: FakeTime) -> None:
    ticks = ticker(time)
    ticks.wait()
    time.now += 1.0
    woke = []
    for _ in range(3):
        ticks.wait()
        woke.append(time.now)
    assert ticks.missed == 49
    assert woke == pytest.approx([1.02, 1.04, 1.06])
