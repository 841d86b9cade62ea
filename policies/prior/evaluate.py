"""What the prior knows of the next second, against holding the last pose and against constant velocity."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

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
Errors = dict[tuple[str, float], float]


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
    table = Table(title=f"mean absolute error of 15 joints, {config.split} clips [rad]")
    table.add_column("forecast")
    for seconds in SECONDS:
        table.add_column(f"{seconds} s", justify="right")
    for name in dict.fromkeys(name for name, _ in errors):
        gain = [f"{errors[name, s]:.4f} ({errors[name, s] / errors['hold', s] - 1:+.0%})" for s in SECONDS]
        table.add_row(name, *gain)
    Console().print(table)
    return errors


@torch.no_grad()
def judge(model: PriorModel, windows: Windows, stride: int) -> Errors:
    """Mean absolute error [rad] by forecast and horizon [s], over windows with a full second of past.

    hold: the last pose stays. constant velocity: the last velocity stays. R: decoded from the mean of R, nothing of the future is
    known. E: decoded from the mean of E, which has seen the future. R past hidden: R, but D sees only the last pose of the past.
    R shuffled, E shuffled: D gets z of another window. R shuffled, past hidden: both.
    """
    history, future, _ = windows.every(stride)
    seen = model.see(history)
    hidden = torch.cat([seen[:, :1], torch.zeros_like(seen[:, 1:])], 1)
    prior, encoder = model.prior(seen).mean, model.encoder(seen, model.foresee(history, future)).mean
    other = torch.randperm(len(seen), generator=torch.Generator().manual_seed(0))
    last = history[:, -1:]
    velocity = (last - history[:, -1 - VELOCITY_FRAMES].unsqueeze(1)) / VELOCITY_FRAMES
    ahead = torch.arange(1, future.shape[1] + 1)[:, None]
    forecasts = {
        "hold": last.expand_as(future),
        "constant velocity": last + velocity * ahead,
        "R": model.decoder(prior, seen, history),
        "R past hidden": model.decoder(prior, hidden, history),
        "R shuffled": model.decoder(prior[other], seen, history),
        "R shuffled, past hidden": model.decoder(prior[other], hidden, history),
        "E": model.decoder(encoder, seen, history),
        "E shuffled": model.decoder(encoder[other], seen, history),
    }
    return {(name, s): _error(motion, future, s) for name, motion in forecasts.items() for s in SECONDS}


def _error(motion: Tensor, future: Tensor, seconds: float) -> float:
    frame = round(seconds * future.shape[1]) - 1
    return float((motion[:, frame] - future[:, frame]).abs().mean())
