"""`teleop-bench prior`: what a motion prior knows of the next second, and what it costs."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from rich.console import Console
from rich.table import Table

from policies.commit import commit
from policies.motion.clip import ClipSet
from policies.prior.evaluate import SECONDS, Error, Errors, judge
from policies.prior.picture import draw
from policies.prior.prior import Prior
from policies.prior.windows import Windows
from robots import catalog

MEASURES: dict[str, Callable[[Error], float]] = {
    "root mean square, rad": lambda error: error.rms,
    "mean square, rad^2": lambda error: error.rms**2,
    "mean absolute, rad": lambda error: error.mean,
}
MANY = 1024
"""Robots of a training."""


@dataclass(frozen=True)
class PriorBench:
    """Compare a prior's forecasts with what came, on clips that it was not trained on.

    Example: teleop-bench prior --clips runs/clips.npz --picture prior.png
    """

    clips: Path
    """Clips of `teleop-train retarget`."""
    prior: str = "prior_h1"
    """Shipped name, or path to a .safetensors file."""
    robot: str = "h1"
    """Name in the catalog."""
    split: str = "val"
    """Split of the clips."""
    stride: int = 5
    """One window in so many is judged."""
    json: Path | None = None
    """Also write the figures to this file."""
    picture: Path | None = None
    """Also draw them to this PNG."""
    curve: Path | None = None
    """curve.csv of the training, to be drawn beside."""


def run(config: PriorBench) -> dict:
    """Measure, print the tables, return the JSON record.

    Raises:
        UnusableClips: the clips are missing, damaged or of another robot.
        NoClips: none of them is of that split.
        UnknownPolicy, WrongWeights, DamagedWeights: see `policies.checkpoint`.
    """
    torch.set_num_threads(1)
    spec = catalog.load(config.robot).spec
    windows = Windows(
        ClipSet.load(config.clips, spec).where(lambda clip: clip.split == config.split), spec.home[spec.group("waist", "arms")]
    )
    prior = Prior.load(config.prior, spec)
    errors = judge(prior.model, windows, config.stride)
    history = windows.every(config.stride)[0].numpy()
    latent = prior.encode(history)
    many = np.resize(history, (MANY, *history.shape[1:]))
    record = {
        "prior": prior.card["name"],
        "commit": commit(),
        "split": config.split,
        "windows": len(history),
        "error": {
            measure: {f"{name} {seconds} s": value(error) for (name, seconds), error in errors.items()}
            for measure, value in MEASURES.items()
        },
        "latent": _latent(latent),
        "ms for 1 robot": _median_ms(lambda: prior.encode(history[0])),
        f"ms for {MANY} robots": _median_ms(lambda: prior.encode(many), times=20),
    }
    _tell(Console(), record, errors)
    if config.json:
        config.json.write_text(json.dumps(record, indent=1) + "\n")
    if config.picture:
        draw(prior.model, windows, config.picture, config.curve)
    return record


def _latent(latent: np.ndarray) -> dict[str, float]:
    """Figures of z [n, 64]: a prior that collapsed has no deviation."""
    variance = np.linalg.eigvalsh(np.cov(latent.T))
    return {
        "mean": float(latent.mean()),
        "deviation": float(latent.std()),
        "least deviation of a number": float(latent.std(0).min()),
        "largest deviation of a number": float(latent.std(0).max()),
        "largest magnitude": float(np.abs(latent).max()),
        "directions in use": float(variance.sum() ** 2 / (variance**2).sum()),
    }


def _tell(console: Console, record: dict, errors: Errors) -> None:
    console.print(f"errors of {record['prior']} over 15 joints and {record['windows']} windows of {record['split']} clips", highlight=False)
    for measure, value in MEASURES.items():
        table = Table(title=f"{measure}; against holding the last pose")
        table.add_column("forecast")
        for seconds in SECONDS:
            table.add_column(f"{seconds} s", justify="right")
        for name in dict.fromkeys(name for name, _ in errors):
            shares = [(value(errors[name, s]), value(errors[name, s]) / value(errors["hold", s]) - 1) for s in SECONDS]
            table.add_row(name, *(f"{error:.3f} {share:+.0%}" for error, share in shares))
        console.print(table)
    console.print("z: " + ", ".join(f"{name} {figure:.2f}" for name, figure in record["latent"].items()), highlight=False)
    told = [f"{name} {record[name]:.2f}" for name in record if name.startswith("ms for")]
    console.print("z of the last second, processor time: " + ", ".join(told), highlight=False)


def _median_ms(call: Callable[[], object], times: int = 200) -> float:
    """Processor time of one thread."""
    taken = []
    for _ in range(times):
        start = time.process_time()
        call()
        taken.append(time.process_time() - start)
    return 1e3 * float(np.median(taken))
