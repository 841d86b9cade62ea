"""A picture of what the prior knows: error over the horizon, the training curve, and forecasts beside what came."""

from __future__ import annotations

import csv
from pathlib import Path

import torch
from torch import Tensor

from policies.picture import canvas
from policies.prior.evaluate import forecasts
from policies.prior.model import PriorModel
from policies.prior.windows import Windows

SHOWN = {
    "hold": "the last pose stays",
    "constant velocity": "the last velocity stays",
    "R": "R: from the past",
    "R shuffled": "R, z of another window",
    "E": "E: has seen the future",
}
LIVELY = (0.7, 0.9)
"""Which windows are shown: by how much moves in them, from 0, the calmest, to 1, the wildest."""
_JOINTS = {2: "left shoulder roll", 4: "left elbow", 8: "right shoulder pitch"}


@torch.no_grad()
def draw(model: PriorModel, windows: Windows, path: Path, curve: Path | None = None) -> None:
    """Write a PNG.

    Args:
        windows: validation windows.
        curve: `curve.csv` of the training run, if it is to be shown.
    """
    history, future, rows = windows.every(10)
    made = forecasts(model, history, future)
    seconds = torch.arange(1, future.shape[1] + 1) / future.shape[1]
    moving = (future - history[:, -1:]).square().mean((1, 2)).argsort()
    top = float((made["hold"] - future).square().mean((0, 2)).sqrt().max())
    with canvas(path, 2, 2, (11, 7)) as axes:
        for name, label in SHOWN.items():
            axes[0, 0].plot(seconds, (made[name] - future).square().mean((0, 2)).sqrt(), label=label)
        axes[0, 0].set(title="error on validation clips", xlabel="seconds ahead", ylabel="rms over joints [rad]", ylim=(0, 1.6 * top))
        axes[0, 0].legend(fontsize=8)
        if curve is not None:
            _curve(axes[0, 1], curve)
        else:
            axes[0, 1].axis("off")
        for axis, lively in zip(axes[1], LIVELY, strict=True):
            row = int(moving[int(lively * len(moving))])
            _example(axis, history[row], future[row], made["R"][row], seconds)
            axis.set(title=f"what came, and what R and D expected (dashed)\n{windows.names[int(rows[row])]}")


def _example(axes, past: Tensor, future: Tensor, forecast: Tensor, seconds: Tensor) -> None:
    """Three joints of one window."""
    for i, (joint, name) in enumerate(_JOINTS.items()):
        colour = f"C{i}"
        axes.plot(torch.cat([seconds - 1, seconds]), torch.cat([past[:, joint], future[:, joint]]), colour, label=name)
        axes.plot(seconds, forecast[:, joint], colour, linestyle="--")
    axes.axvline(0, color="grey", linewidth=0.5)
    axes.set(xlabel="seconds from now", ylabel="joint target [rad]")
    axes.legend(fontsize=8)


def _curve(axes, path: Path) -> None:
    with path.open() as file:
        rows = list(csv.DictReader(file))
    steps = [float(row["step"]) for row in rows]
    for name in ("hold 0.5", "R 0.5", "E 0.5"):
        axes.plot(steps, [float(row[name]) for row in rows], label=f"{name} s")
    axes.set(title="while training", xlabel="batches", ylabel="rms on validation clips [rad]", ylim=(0, None))
    twin = axes.twinx()
    twin.plot(steps, [float(row["kl"]) for row in rows], "grey", linestyle=":")
    twin.set(ylabel="KL(E || R) [nats], dotted", ylim=(0, None))
    axes.legend(fontsize=8)
