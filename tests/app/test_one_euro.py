"""The filter: a resting hand's tremble is smoothed, a moving hand is hardly late, and the delay told is the delay there is."""

from __future__ import annotations

import numpy as np
import pytest

from app.one_euro import OneEuro

DT = 0.02
REST = np.array([0.3, 0.2, 0.1, 1, 0, 0, 0])


def moved(x: float, angle: float = 0.0) -> np.ndarray:
    return np.array([0.3 + x, 0.2, 0.1, np.cos(angle / 2), 0, 0, np.sin(angle / 2)])


def test_a_tremble_of_3_mm_at_rest_is_less_than_half_as_large() -> None:
    smooth, random = OneEuro(REST, DT), np.random.default_rng(0)
    noise = random.normal(0, 0.003, 500)
    out = np.array([smooth.step(moved(x))[0] - 0.3 for x in noise])
    assert out[50:].std() < 0.5 * noise.std()


def test_a_hand_that_moves_is_as_late_as_it_says_and_earlier_than_one_at_rest() -> None:
    smooth = OneEuro(REST, DT)
    smooth.step(REST)
    at_rest = smooth.delay
    speed = 0.5
    for i in range(1, 100):
        out = smooth.step(moved(speed * i * DT))
    lag = (0.3 + speed * 99 * DT - out[0]) / speed
    assert lag == pytest.approx(smooth.delay, abs=0.001)
    assert smooth.delay < 0.03 < 0.06 < at_rest


def test_turns_are_smoothed_and_stay_unit_and_arrive() -> None:
    smooth = OneEuro(REST, DT)
    first = smooth.step(moved(0, 0.5))
    assert 0 < 2 * np.arccos(first[3]) < 0.4
    for _ in range(200):
        out = smooth.step(moved(0, 0.5))
        assert np.linalg.norm(out[3:]) == pytest.approx(1)
    np.testing.assert_allclose(out, moved(0, 0.5), atol=1e-3)
