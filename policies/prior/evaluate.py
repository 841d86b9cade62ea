"""What the prior knows of the next second, against holding the last pose and against constant velocity."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import torch
from rich.console import Console
from rich.table import Table
from torch import Tensor

from policies.motion.clip import ClipSet
from policies.prior.model import PriorModel
from policies.prior.prior import Prior
from policies.prior.windows import Windows
from robots import catalog

SECONDS = (0.2, 0.5, 1.0)
"""Horizons of the tables."""
VELOCITY_FRAMES = 3
"""Frames over which the last velocity is taken."""


class Error(NamedTuple):
    """Over joints and windows [rad]."""

    mean: float
    """Mean absolute error."""
    rms: float
    """Root mean square error: what large motions, which matter to the legs, decide."""


Errors = dict[tuple[str, float], Error]
"""By forecast and horizon [s]."""


@dataclass(frozen=True)
class EvaluateConfig:
    """Print what a prior forecasts on the validation clips."""

    clips: Path
    """Clips of `teleop-train retarget`."""
    prior: str = "prior_h1"
    """Shipped name, or path to a .safetensors file."""
    robot: str = "h1"
    """Name in the catalog."""
    split: str = "val"
    """Split of the clips."""


def evaluate(config: EvaluateConfig) -> Errors:
    """Print the table of forecast errors on a split and return it."""
    spec = catalog.load(config.robot).spec
    clips = ClipSet.load(config.clips, spec).where(lambda clip: clip.split == config.split)
    prior = Prior.load(config.prior, spec)
    windows = Windows(clips, spec.home[spec.group("waist", "arms")])
    errors = judge(prior.model, windows, stride=5)
    table = Table(title=f"error of 15 joints on {config.split} clips: rms, mean absolute [rad], each against holding the last pose")
    table.add_column("forecast")
    for seconds in SECONDS:
        table.add_column(f"{seconds} s", justify="right")
    for name in dict.fromkeys(name for name, _ in errors):
        table.add_row(name, *(_cell(errors[name, s], errors["hold", s]) for s in SECONDS))
    console = Console()
    console.print(table)
    history = windows.every(len(windows))[0][0].numpy()
    console.print(f"encoding one robot's second: {1e3 * _median_seconds(lambda: prior.encode(history)):.2f} ms")
    return errors


@torch.no_grad()
def judge(model: PriorModel, windows: Windows, stride: int) -> Errors:
    """Errors by forecast and horizon, over one in `stride` of the windows with a full second of past."""
    history, future, _ = windows.every(stride)
    made = forecasts(model, history, future)
    return {(name, s): _error(motion, future, s) for name, motion in made.items() for s in SECONDS}


@torch.no_grad()
def forecasts(model: PriorModel, history: Tensor, future: Tensor) -> dict[str, Tensor]:
    """The next second [n, WINDOW, 15], rad, by name, from windows [n, WINDOW, 15] each.

    hold: the last pose stays. constant velocity: the last velocity stays. R: decoded from the mean of R, nothing of the future is
    known. E: decoded from the mean of E, which has seen the future. R past hidden: R, but D sees only the last pose of the past.
    R shuffled, E shuffled: D gets z of another window. R shuffled, past hidden: both.
    """
    seen = model.see(history)
    hidden = torch.cat([seen[:, :1], torch.zeros_like(seen[:, 1:])], 1)
    prior, encoder = model.prior(seen).mean, model.encoder(seen, model.foresee(history, future)).mean
    other = torch.randperm(len(seen), generator=torch.Generator().manual_seed(0))
    last = history[:, -1:]
    velocity = (last - history[:, -1 - VELOCITY_FRAMES].unsqueeze(1)) / VELOCITY_FRAMES
    ahead = torch.arange(1, future.shape[1] + 1)[:, None]
    return {
        "hold": last.expand_as(future),
        "constant velocity": last + velocity * ahead,
        "R": model.decoder(prior, seen, history),
        "R past hidden": model.decoder(prior, hidden, history),
        "R shuffled": model.decoder(prior[other], seen, history),
        "R shuffled, past hidden": model.decoder(prior[other], hidden, history),
        "E": model.decoder(encoder, seen, history),
        "E shuffled": model.decoder(encoder[other], seen, history),
    }


def _error(motion: Tensor, future: Tensor, seconds: float) -> Error:
    frame = round(seconds * future.shape[1]) - 1
    off = motion[:, frame] - future[:, frame]
    return Error(float(off.abs().mean()), float(off.square().mean().sqrt()))


def _median_seconds(call: Callable[[], object], times: int = 200) -> float:
    taken = []
    for _ in range(times):
        start = time.perf_counter()
        call()
        taken.append(time.perf_counter() - start)
    return sorted(taken)[times // 2]


def _cell(error: Error, hold: Error) -> str:
    return f"{error.rms:.3f} {error.rms / hold.rms - 1:+.0%}  {error.mean:.3f} {error.mean / hold.mean - 1:+.0%}"
