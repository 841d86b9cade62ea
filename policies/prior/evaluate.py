"""What the prior knows of the next second, against holding the last pose and against constant velocity."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from policies.prior.model import PriorModel
from policies.prior.windows import Windows

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
