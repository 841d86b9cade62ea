"""Environment, learner and everything a checkpoint must hold."""

from __future__ import annotations

import csv
import json
import os
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
import torch.distributed as dist
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from policies import checkpoint
from policies.commit import commit
from policies.errors import NothingToBeginWith, OtherMotions
from policies.motion import reaches
from policies.motion.clip import ClipSet
from policies.networks import Actor, Critic
from policies.observation import action_mirror, where
from policies.ppo.algorithm import PPO
from policies.ppo.config import STAGES, WalkConfig
from policies.ppo.env import WalkEnv
from policies.ppo.rewards import VELOCITY
from policies.prior.errors import OtherTraining
from policies.prior.prior import Prior
from robots import catalog
from robots.spec import RobotSpec

AVERAGED = 0.98
"""Share of the exported actor that an update leaves as it was: a mean over some 50 updates."""


class Trainer:
    """Environment, learner and everything a checkpoint must hold."""

    def __init__(self, config: WalkConfig) -> None:
        self.config = config
        robot = catalog.load(config.robot)
        self._rank, self._processes = (dist.get_rank(), dist.get_world_size()) if dist.is_initialized() else (0, 1)
        seed = config.seed + 1000 * self._rank
        prior = Prior.load(config.prior, robot.spec) if config.prior else None
        self.env = WalkEnv(robot, _motions(config, robot.spec), prior, config.count, seed, threads=config.threads)
        self.env.playback.alpha[:] = config.alpha if config.curriculum else 1.0
        self.env.playback.adaptive = config.curriculum
        self.device = "cuda" if config.device == "auto" and torch.cuda.is_available() else config.device.replace("auto", "cpu")
        actor_mirror, critic_mirror = self.env.mirrors
        self.actor = Actor(actor_mirror, action_mirror(robot.spec)).to(self.device)
        self.critic = Critic(critic_mirror).to(self.device)
        self.average = AveragedModel(self.actor, multi_avg_fn=get_ema_multi_avg_fn(AVERAGED), use_buffers=True)
        """What is exported: an update moves the actor this way and that; its running mean is steadier on its feet."""
        torch.manual_seed(seed)  # the networks begin alike in every process, the exploration does not
        self.ppo = PPO(self.actor, self.critic, config.ppo)
        self.steps, self.stage, self.seconds = 0, 0, 0.0
        self.begun_at = 0
        """Steps behind the networks that this run began with."""
        self.curves: list[dict] = []
        self._now: tuple[torch.Tensor, torch.Tensor] | None = None

    def iterate(self) -> dict:
        """One rollout and one update; returns the row that goes to curves.csv."""
        began = time.monotonic()
        env, ppo = self.env, self.ppo
        now = self._now or self._tensors(*env.start(STAGES[self.stage]))
        alpha = env.playback.alpha.copy()
        for _ in range(self.config.ppo.horizon):
            action = ppo.act(*now)
            seen, extra, reward, ended, late = env.step(action.cpu().numpy().astype(np.float64))
            ppo.outcome(*(torch.as_tensor(x, dtype=torch.float32, device=self.device) for x in (reward, ended, late)))
            now = self._tensors(seen, extra)
        self._now = now
        learnt = ppo.update(now[1])
        self.average.update_parameters(self.actor)
        self._share(alpha)
        count = self.config.count * self.config.ppo.horizon * self._processes
        self.steps += count
        self.seconds += time.monotonic() - began
        row = {"steps": self.steps, "stage": STAGES[self.stage].name, "steps_per_second": count / (time.monotonic() - began)}
        row |= {k: round(float(np.mean(v)), 4) for k, v in env.log.items()} | {k: round(v, 6) for k, v in learnt.items()}
        row |= {"amplitude": float(env.playback.alpha.mean()), "penalty": env.penalty, "seconds": self.seconds}
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

    def _share(self, before: np.ndarray) -> None:
        """What every process's robots earned for a motion since `before` counts for all."""
        if self._processes > 1:
            playback = self.env.playback
            earned = torch.as_tensor(playback.alpha - before)
            dist.all_reduce(earned)
            playback.alpha[:] = np.clip(before + earned.numpy(), 0, 1)

    def save(self) -> None:
        """Checkpoint and curves; a kill while writing leaves the previous ones."""
        run = self.config.run
        run.mkdir(parents=True, exist_ok=True)
        aside = run / ".checkpoint.pt"
        torch.save(
            {
                "actor": self.actor.state_dict(), "average": self.average.state_dict(),
                "critic": self.critic.state_dict(), "optimiser": self.ppo.optimiser.state_dict(),
                "lr": self.ppo.lr, "steps": self.steps, "begun_at": self.begun_at, "stage": self.stage,
                "seconds": self.seconds, "penalty": self.env.penalty,
                "alpha": torch.as_tensor(self.env.playback.alpha), "prior": self.config.prior, "curves": json.dumps(self.curves),
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
        """Continue from the run's checkpoint, if it has one.

        Raises:
            NothingToBeginWith: the run to begin with has none.
            OtherTraining: the run was begun with another motion prior, or without one.
            OtherMotions: it was begun with another number of motions.
        """
        path = self.config.run / "checkpoint.pt"
        if not path.exists():
            if self.config.begin:
                self._begin(self.config.begin / "checkpoint.pt")
            return
        kept = torch.load(path, weights_only=True, map_location=self.device)
        if kept["prior"] != self.config.prior:
            raise OtherTraining(self.config.run, ["prior"])
        if len(kept["alpha"]) != len(self.env.playback.alpha):
            raise OtherMotions(path, len(kept["alpha"]), len(self.env.playback.alpha))
        self.actor.load_state_dict(kept["actor"])
        self.average.load_state_dict(kept["average"])
        self.critic.load_state_dict(kept["critic"])
        self.ppo.optimiser.load_state_dict(kept["optimiser"])
        self.ppo.lr, self.steps, self.stage, self.seconds = kept["lr"], kept["steps"], kept["stage"], kept["seconds"]
        self.env.penalty, self.begun_at, self.curves = kept["penalty"], kept["begun_at"], json.loads(kept["curves"])
        self.env.playback.alpha[:] = kept["alpha"].cpu().numpy()

    def _begin(self, path: Path) -> None:
        """Take the networks of another run into the last stage. If its z came from another prior, or none, the first layer starts
        blind to z and with fresh statistics of it, so that the policy begins exactly as good as it was."""
        if not path.exists():
            raise NothingToBeginWith(path)
        kept = torch.load(path, weights_only=True, map_location=self.device)
        self.stage, self.env.penalty, self.begun_at = len(STAGES) - 1, kept["penalty"], kept["begun_at"] + kept["steps"]
        self.actor.load_state_dict(kept["actor"])
        self.critic.load_state_dict(kept["critic"])
        self.ppo.lr = kept["lr"]  # what fits networks that know nothing would undo much of what these know
        if kept["prior"] != self.config.prior:
            self._forget_latent()

    def _forget_latent(self) -> None:
        latent = where(self.env.observer.spec, "latent")
        for network, seen in zip((self.actor, self.critic), self._sample(), strict=True):
            mask = network.inputs.basis[:, latent].abs().sum(-1) > 0
            network.normaliser.adopt(network.inputs(seen), mask)
            network.body.ignore(mask)

    def _sample(self) -> tuple[torch.Tensor, torch.Tensor]:
        """What actor and critic see while every motion plays in full, the legs still: statistics of z."""
        playback = self.env.playback
        alpha = playback.alpha.copy()
        playback.alpha[:] = 1
        self.env.start(STAGES[-1])
        seen = [self._tensors(*self.env.step(np.zeros((self.config.count, 12)))[:2]) for _ in range(60)]
        playback.alpha[:] = alpha
        self.env.log.clear()
        return torch.cat([x for x, _ in seen[30:]]), torch.cat([y for _, y in seen[30:]])

    def export(self, path: Path) -> Path:
        """The averaged actor with its card."""
        card = {
            "kind": "walk", "name": path.stem, "robot": self.config.robot, "observation": self.env.observer.size, "action": 12,
            "prior": self.config.prior, "curriculum": self.config.curriculum, "steps": self.steps, "begun_at": self.begun_at,
            "seed": self.config.seed, "commit": commit(), "hours": round(self.seconds / 3600, 2),
        }  # fmt: skip
        checkpoint.save(path, self.average.module.state_dict(), card)
        return path

    def _tensors(self, observation: np.ndarray, extra: np.ndarray) -> tuple[torch.Tensor, torch.Tensor]:
        seen = torch.from_numpy(observation).to(self.device)
        return seen, torch.cat([seen, torch.from_numpy(extra).to(self.device)], -1)


def _motions(config: WalkConfig, spec: RobotSpec) -> ClipSet:
    """Random reaches, and the training clips in which somebody stays on the ground."""
    sets = [ClipSet.load(path, spec).split("train").grounded() for path in config.motions]
    sets.append(reaches.clips(spec, config.reaches, np.random.default_rng(config.seed)))
    return ClipSet.of(spec, (clip for clips in sets for clip in clips.clips))
