"""`teleop-train walk`: teach the legs, stage by stage, with checkpoints that resume after a kill."""

from __future__ import annotations

import csv
import json
import os
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
import torch
from rich.live import Live
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from policies import checkpoint
from policies.commit import commit
from policies.networks import Actor, Critic
from policies.observation import action_mirror
from policies.ppo.algorithm import PPO, PPOConfig
from policies.ppo.env import Stage, WalkEnv
from policies.ppo.rewards import VELOCITY
from robots import catalog

STAGES = (
    Stage("A", 6e6, stand=0.12, vx=(0.2, 0.8), vy=0.1, yaw=0.3, push=0.3, arms=False),
    Stage("B", 12e6, stand=0.25, push=0.8, posture=0.15),
    Stage("C", 1e12, stand=0.3, push=1.3, posture=0.35),
)


@dataclass(frozen=True)
class WalkConfig:
    """Train a leg policy.

    Example: teleop-train walk --run runs/walk --steps 40e6
    The same command again resumes from the last checkpoint.
    """

    run: Path = Path("runs/walk")
    """Folder of checkpoints, curves and a copy of this configuration."""
    robot: str = "h1"
    """Name in the catalog."""
    steps: float = 40e6
    """Control steps to train for, over all resumptions."""
    count: int = 1024
    """Robots simulated side by side."""
    seed: int = 1
    """Of environments and networks."""
    threads: int = 0
    """Physics threads; 0 takes every core."""
    torch_threads: int = 2
    """Threads of the learner."""
    save_minutes: float = 3.0
    """Time between checkpoints."""
    ppo: PPOConfig = field(default_factory=PPOConfig)
    """The learner."""


def train(config: WalkConfig) -> Path:
    """Train until `steps`; returns the path of the exported weights (safetensors with a card)."""
    torch.manual_seed(config.seed)
    torch.set_num_threads(config.torch_threads)
    trainer = Trainer(config)
    trainer.resume()
    with _progress() as (bar, live):
        task = bar.add_task("walk", total=config.steps, completed=trainer.steps)
        saved = time.monotonic()
        try:
            while trainer.steps < config.steps:
                row = trainer.iterate()
                bar.update(task, completed=trainer.steps, description=f"stage {row['stage']}  {row['steps_per_second']:.0f} steps/s")
                live.update(_table(bar, row))
                if not live.console.is_terminal:
                    print(" ".join(f"{k}={v:.3g}" if isinstance(v, float) else f"{k}={v}" for k, v in row.items()), flush=True)
                if time.monotonic() - saved > 60 * config.save_minutes:
                    trainer.save()
                    saved = time.monotonic()
        except KeyboardInterrupt:
            live.console.print(f"stopped at {trainer.steps} steps; the same command continues")
    trainer.save()
    return trainer.export(config.run / "walk.safetensors")


class Trainer:
    """Environment, learner and everything a checkpoint must hold."""

    def __init__(self, config: WalkConfig) -> None:
        self.config = config
        robot = catalog.load(config.robot)
        self.env = WalkEnv(robot, config.count, config.seed, threads=config.threads)
        actor_mirror, critic_mirror = self.env.mirrors
        self.actor = Actor(actor_mirror, action_mirror(robot.spec))
        self.critic = Critic(critic_mirror)
        self.ppo = PPO(self.actor, self.critic, config.ppo)
        self.steps, self.stage, self.seconds = 0, 0, 0.0
        self.curves: list[dict] = []
        self._now: tuple[torch.Tensor, torch.Tensor] | None = None

    def iterate(self) -> dict:
        """One rollout and one update; returns the row that goes to curves.csv."""
        began = time.monotonic()
        env, ppo = self.env, self.ppo
        now = self._now or _tensors(*env.start(STAGES[self.stage]))
        for _ in range(self.config.ppo.horizon):
            action = ppo.act(*now)
            seen, extra, reward, ended, late = env.step(action.numpy().astype(np.float64))
            ppo.outcome(*(torch.as_tensor(x, dtype=torch.float32) for x in (reward, ended, late)))
            now = _tensors(seen, extra)
        self._now = now
        learnt = ppo.update(now[1])
        count = self.config.count * self.config.ppo.horizon
        self.steps += count
        self.seconds += time.monotonic() - began
        row = {"steps": self.steps, "stage": STAGES[self.stage].name, "steps_per_second": count / (time.monotonic() - began)}
        row |= {k: round(float(np.mean(v)), 4) for k, v in env.log.items()} | {k: round(v, 6) for k, v in learnt.items()}
        row |= {"amplitude": float(env.amplitude.mean()), "penalty": env.penalty, "seconds": self.seconds}
        env.log.clear()
        self.curves.append(row)
        self._curriculum()
        return row

    def _curriculum(self) -> None:
        """Heavier penalties as episodes lengthen; the next stage when this one is mastered or its time is up."""
        recent = self.curves[-20:]
        survived = float(np.mean([r["survived"] for r in recent if "survived" in r] or [0]))
        velocity = float(np.mean([r["velocity"] for r in recent])) / VELOCITY
        if survived > 0.6:
            self.env.penalty = min(1.0, self.env.penalty * 1.015)
        stage = STAGES[self.stage]
        mastered = stage.name == "A" and survived > 0.8 and velocity > 0.7 and self.env.penalty > 0.5
        if self.stage + 1 < len(STAGES) and (mastered or self.steps >= stage.steps):
            self.stage += 1
            self.env.stage = STAGES[self.stage]

    def save(self) -> None:
        """Checkpoint and curves; a kill while writing leaves the previous ones."""
        run = self.config.run
        run.mkdir(parents=True, exist_ok=True)
        aside = run / ".checkpoint.pt"
        torch.save(
            {
                "actor": self.actor.state_dict(), "critic": self.critic.state_dict(), "optimiser": self.ppo.optimiser.state_dict(),
                "lr": self.ppo.lr, "steps": self.steps, "stage": self.stage, "seconds": self.seconds, "penalty": self.env.penalty,
                "amplitude": torch.as_tensor(self.env.amplitude), "curves": json.dumps(self.curves),
            },
            aside,
        )  # fmt: skip
        os.replace(aside, run / "checkpoint.pt")
        (run / "config.json").write_text(json.dumps(asdict(self.config) | {"commit": commit()}, indent=1, default=str) + "\n")
        names = list(dict.fromkeys(name for row in self.curves for name in row))
        with (run / "curves.csv").open("w", newline="") as file:
            writer = csv.DictWriter(file, names)
            writer.writeheader()
            writer.writerows(self.curves)
        self.export(run / "walk.safetensors")

    def resume(self) -> None:
        """Continue from the run's checkpoint, if it has one."""
        path = self.config.run / "checkpoint.pt"
        if not path.exists():
            return
        kept = torch.load(path, weights_only=True)
        self.actor.load_state_dict(kept["actor"])
        self.critic.load_state_dict(kept["critic"])
        self.ppo.optimiser.load_state_dict(kept["optimiser"])
        self.ppo.lr, self.steps, self.stage, self.seconds = kept["lr"], kept["steps"], kept["stage"], kept["seconds"]
        self.env.penalty, self.curves = kept["penalty"], json.loads(kept["curves"])
        self.env.amplitude = np.resize(kept["amplitude"].numpy(), self.config.count)

    def export(self, path: Path) -> Path:
        """The actor with its card."""
        card = {
            "kind": "walk", "name": path.stem, "robot": self.config.robot, "observation": self.env.observer.size, "action": 12,
            "prior": None, "steps": self.steps, "seed": self.config.seed, "commit": commit(), "hours": round(self.seconds / 3600, 2),
        }  # fmt: skip
        checkpoint.save(path, self.actor.state_dict(), card)
        return path


def _tensors(observation: np.ndarray, extra: np.ndarray) -> tuple[torch.Tensor, torch.Tensor]:
    seen = torch.from_numpy(observation)
    return seen, torch.cat([seen, torch.from_numpy(extra)], -1)


class _progress:
    """A progress bar over a live table of the reward terms."""

    def __enter__(self) -> tuple[Progress, Live]:
        bar = Progress(
            TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed:.2e} of {task.total:.0e}"), TimeRemainingColumn()
        )
        self._live = Live(bar, refresh_per_second=1)
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
