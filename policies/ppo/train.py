"""`teleop-train walk`: teach the legs, stage by stage, with checkpoints that resume after a kill."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import torch
import torch.distributed as dist
from rich.console import Console
from rich.live import Live
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from policies.ppo.config import WalkConfig
from policies.ppo.trainer import Trainer


def train(config: WalkConfig) -> Path:
    """Train until `steps`; returns the path of the exported weights (safetensors with a card)."""
    torch.manual_seed(config.seed)
    torch.set_num_threads(config.torch_threads)
    with _processes() as first, _progress(shown=first) as (bar, live):
        trainer = Trainer(config)
        trainer.resume()
        task = bar.add_task("walk", total=config.steps, completed=trainer.steps)
        saved = time.monotonic()
        try:
            while trainer.steps < config.steps:
                row = trainer.iterate()
                if not first:
                    continue
                bar.update(task, completed=trainer.steps, description=f"stage {row['stage']}  {row['steps_per_second']:.0f} steps/s")
                live.update(_table(bar, row))
                if not live.console.is_terminal:
                    print(" ".join(f"{k}={v:.3g}" if isinstance(v, float) else f"{k}={v}" for k, v in row.items()), flush=True)
                if time.monotonic() - saved > 60 * config.save_minutes:
                    trainer.save()
                    saved = time.monotonic()
        except KeyboardInterrupt:
            live.console.print(f"stopped at {trainer.steps} steps; the same command continues")
        if first:
            trainer.save()
    return config.run / "walk.safetensors"


@contextmanager
def _processes() -> Iterator[bool]:
    """Join the other processes if torchrun started several; whether this is the first, which shows and saves."""
    if "WORLD_SIZE" not in os.environ:
        yield True
        return
    dist.init_process_group("gloo")
    try:
        yield dist.get_rank() == 0
    finally:
        dist.destroy_process_group()


class _progress:
    """A progress bar over a live table of the reward terms."""

    def __init__(self, shown: bool) -> None:
        self._shown = shown

    def __enter__(self) -> tuple[Progress, Live]:
        bar = Progress(
            TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed:.2e} of {task.total:.0e}"), TimeRemainingColumn()
        )
        self._live = Live(bar, refresh_per_second=1, console=Console(quiet=not self._shown))
        self._live.__enter__()
        return bar, self._live

    def __exit__(self, *error: object) -> None:
        self._live.__exit__(None, None, None)


def _table(bar: Progress, row: dict) -> Table:
    grid, terms = Table.grid(), Table(box=None)
    for _ in range(4):
        terms.add_column()
        terms.add_column(justify="right")
    cells = [cell for name, value in row.items() if isinstance(value, float) for cell in (name, f"{value:.4g}")]
    for i in range(0, len(cells), 8):
        terms.add_row(*cells[i : i + 8])
    grid.add_row(bar)
    grid.add_row(terms)
    return grid
