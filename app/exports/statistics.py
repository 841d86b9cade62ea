"""Mean, spread and quantiles of exported numbers, as training libraries normalise by them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}

Statistics = dict[str, np.ndarray]
"""min, max, mean, std, count and QUANTILES, an array each."""


def of_values(values: np.ndarray) -> Statistics:
    """Over the rows of values [n, k] or [n]."""
    columns = np.asarray(values, dtype=np.float64).reshape(len(values), -1)
    found = {"min": columns.min(0), "max": columns.max(0), "mean": columns.mean(0), "std": columns.std(0)}
    return found | {"count": np.array([len(columns)])} | {name: np.quantile(columns, q, axis=0) for name, q in QUANTILES.items()}


def merged(parts: Sequence[Statistics]) -> Statistics:
    """Of several episodes together. Quantiles are weighted means of the episodes' own, as LeRobot merges them."""
    counts = np.array([part["count"][0] for part in parts], dtype=np.float64)

    def weighted(name: str) -> np.ndarray:
        return np.average([part[name] for part in parts], axis=0, weights=counts)

    mean = weighted("mean")
    squares = np.average([part["std"] ** 2 + (part["mean"] - mean) ** 2 for part in parts], axis=0, weights=counts)
    extremes = {"min": np.min([part["min"] for part in parts], axis=0), "max": np.max([part["max"] for part in parts], axis=0)}
    return extremes | {"mean": mean, "std": np.sqrt(squares), "count": np.array([int(counts.sum())])} | {q: weighted(q) for q in QUANTILES}


class Brightness:
    """Statistics of pictures, gathered picture by picture: a channel each [3, 1, 1], in 0..1."""

    def __init__(self) -> None:
        self._histogram, self._pictures = np.zeros((3, 256), np.int64), 0

    def see(self, picture: np.ndarray) -> None:
        """One more [height, width, 3] uint8."""
        self._pictures += 1
        for channel in range(3):
            self._histogram[channel] += np.bincount(picture[..., channel].ravel(), minlength=256)

    def statistics(self) -> Statistics:
        """Of all pictures so far; count is that of the pictures."""
        levels, shares = np.arange(256) / 255, self._histogram / self._histogram.sum(1, keepdims=True)
        reached, present = np.cumsum(shares, axis=1), self._histogram > 0
        mean = shares @ levels
        found = {
            "min": levels[present.argmax(1)],
            "max": levels[255 - present[:, ::-1].argmax(1)],
            "mean": mean,
            "std": np.sqrt(np.maximum(shares @ levels**2 - mean**2, 0)),
            **{name: levels[(reached >= q - 1e-12).argmax(1)] for name, q in QUANTILES.items()},
        }
        return {name: value.reshape(3, 1, 1) for name, value in found.items()} | {"count": np.array([self._pictures])}
