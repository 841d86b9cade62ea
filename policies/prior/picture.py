"""A picture of what the prior knows: error over the horizon, the training curve, and forecasts beside what came."""

from __future__ import annotations

import csv
from pathlib import Path

import matplotlib as mpl
import torch
from torch import Tensor

from policies.prior.evaluate import forecasts
from policies.prior.model import PriorModel
from policies.prior.windows import Windows

SHOWN = ("hold", "constant velocity", "R", "R shuffled", "E")
_JOINTS = {2: "left shoulder roll", 4: "left elbow", 8: "right shoulder pitch"}


@torch.no_grad()
def draw(model: PriorModel, windows: Windows, path: Path, curve: Path | None = None) -> None:
    """Write a PNG.

    Args:
        windows: validation windows.
        curve: `curve.csv` of the training run, if it is to be shown.
    """
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    history, future, _ = windows.every(10)
    made = forecasts(model, history, future)
    seconds = torch.arange(1, future.shape[1] + 1) / future.shape[1]
    figure, axes = plt.subplots(1, 3, figsize=(12, 3.4), layout="constrained")
    for name in SHOWN:
        axes[0].plot(seconds, (made[name] - future).square().mean((0, 2)).sqrt(), label=name)
    top = float((made["hold"] - future).square().mean((0, 2)).sqrt().max())
    axes[0].set(title="error on validation clips", xlabel="seconds ahead", ylabel="rms over joints [rad]", ylim=(0, 1.6 * top))
    axes[0].legend(fontsize=8)
    _examples(axes[1], history, future, made["R"], seconds)
    if curve is not None:
        _curve(axes[2], curve)
    else:
        axes[2].axis("off")
    figure.savefig(path, dpi=80)
    plt.close(figure)


def _examples(axes, history: Tensor, future: Tensor, forecast: Tensor, seconds: Tensor) -> None:
    """Three joints of the window whose motion is at the 90th percentile: neither at rest nor the wildest."""
    moving = (future - history[:, -1:]).square().mean((1, 2))
    row = int(moving.argsort()[int(0.9 * len(moving))])
    past = seconds - 1
    for i, (joint, name) in enumerate(_JOINTS.items()):
        colour = f"C{i}"
        axes.plot(past, history[row, :, joint], colour, label=name)
        axes.plot(seconds, future[row, :, joint], colour)
        axes.plot(seconds, forecast[row, :, joint], colour, linestyle="--")
    axes.axvline(0, color="grey", linewidth=0.5)
    axes.set(title="a forecast (dashed) from R", xlabel="seconds", ylabel="joint target [rad]")
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
