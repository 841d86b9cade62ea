"""Makes joint curves fit for motors: zero-phase low-pass, resampling, and a bound on speed that shifts nothing in time."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt


def low_pass(x: np.ndarray, rate: float, cutoff: float) -> np.ndarray:
    """Fourth-order zero-phase Butterworth (second order, both ways) along time [T, ...]; cutoff in Hz."""
    sections = butter(2, cutoff / (rate / 2), output="sos")
    return sosfiltfilt(sections, x, axis=0, padlen=min(len(x) - 1, int(2 * rate / cutoff)))


def resample(x: np.ndarray, rate: float, wanted: float) -> np.ndarray:
    """The curve [T, ...] at another rate, by cubic splines; ends at the last new sample within the old ones."""
    duration = (len(x) - 1) / rate
    at = np.arange(int(duration * wanted + 1e-6) + 1) / wanted
    return CubicSpline(np.arange(len(x)) / rate, x, axis=0)(at)


def bound_speed(x: np.ndarray, step: np.ndarray) -> np.ndarray:
    """The curve [T, n] held to `step` [n] a sample: the mean of a limit run forwards and one run backwards, so without delay."""
    return (_chase(x, step) + _chase(x[::-1], step)[::-1]) / 2


def _chase(x: np.ndarray, step: np.ndarray) -> np.ndarray:
    if (np.abs(np.diff(x, axis=0)) <= step).all():
        return x
    y = x.copy()
    for t in range(1, len(x)):
        y[t] = y[t - 1] + np.clip(x[t] - y[t - 1], -step, step)
    return y
