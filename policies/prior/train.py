"""`teleop-train prior`: teach R, E and D on clips, with checkpoints that resume after a kill."""

from __future__ import annotations

import csv
import json
import math
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path

import torch
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from torch import Tensor

from policies import checkpoint
from policies.commit import commit
from policies.motion.clip import ClipSet
from policies.prior.errors import NoClips, OtherTraining
from policies.prior.evaluate import judge
from policies.prior.history import WINDOW
from policies.prior.model import PriorModel, Shape
from policies.prior.single import KIND
from policies.prior.windows import Variation, Windows
from robots import catalog

FIT_WINDOWS = 20_000
"""Windows from which the normalisation is taken."""
SPREAD = 0.2
"""Scale of the Laplace distribution that D is the centre of [rad], in the orthonormal coordinates of the curves: what an error costs
against a nat of KL."""
SOFT = 0.2
"""Errors well below this count by their square [rad]."""

FREE = ("clips", "synthetic", "run", "steps", "torch_threads", "save_minutes", "judge_every")
"""What of a configuration may change when a training is resumed; files may have moved."""


@dataclass(frozen=True)
class Terms:
    """The loss: reconstruction from E, the same from the mean of R, and beta KL(E || R)."""

    beta: float = 1.0
    """Weight of the KL divergence at the end of its warm-up."""
    warm_up: float = 0.25
    """Share of the training over which beta rises from 0."""
    free_nats: float = 0.02
    """KL a number of z that costs nothing: keeps numbers from dying before the decoder has learnt to read them."""
    from_prior: float = 1.0
    """Weight of the reconstruction from the mean of R: what the leg policy will see must hold the forecast by itself."""
    hidden_past: float = 0.8
    """Share of samples in which D sees only the last pose of M0, so that what it knows of the motion comes through z."""


@dataclass(frozen=True)
class PriorConfig:
    """Train the motion prior on retargeted clips.

    Example: teleop-train prior --clips runs/clips.npz --synthetic runs/synthetic.npz --run runs/prior

    The same command again resumes from the last checkpoint.
    """

    clips: Path | None = None
    """Clips of `teleop-train retarget`; without them only synthetic ones are used."""
    synthetic: Path | None = None
    """Clips of `teleop-train synthetic`."""
    run: Path = Path("runs/prior")
    """Folder of checkpoint, curve and a copy of this configuration."""
    robot: str = "h1"
    """Name in the catalog."""
    steps: int = 8_000
    """Batches to train for, over all resumptions."""
    batch: int = 256
    """Windows a batch."""
    synthetic_share: float = 0.25
    """Share of synthetic windows in a batch when there are both kinds."""
    learning_rate: float = 2e-3
    """Highest rate of AdamW; falls to a hundredth along a cosine."""
    weight_decay: float = 0.02
    """Of AdamW."""
    seed: int = 1
    """Of networks and batches."""
    torch_threads: int = 1
    """Threads of the learner."""
    save_minutes: float = 2.0
    """Time between checkpoints."""
    judge_every: int = 500
    """Batches between two looks at the validation clips."""
    shape: Shape = field(default_factory=Shape)
    """Sizes of the networks."""
    terms: Terms = field(default_factory=Terms)
    """The loss."""
    variation: Variation = field(default_factory=Variation)
    """How training windows differ from the clips."""


def train(config: PriorConfig) -> Path:
    """Train until `steps`; returns the path of the exported weights (safetensors with a card).

    Raises:
        UnusableClips: a clip store is missing, damaged or of another robot.
        NoClips: neither clips nor synthetic clips were given, or a split of them is empty.
        OtherTraining: the run's folder holds a training with another configuration.
    """
    torch.manual_seed(config.seed)
    torch.set_num_threads(config.torch_threads)
    trainer = Trainer(config)
    trainer.resume()
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed:.0f}"), TimeRemainingColumn())
    saved = time.monotonic()
    with Progress(*columns) as bar:
        task = bar.add_task("prior", total=config.steps, completed=trainer.step)
        try:
            while trainer.step < config.steps:
                losses = trainer.iterate()
                bar.update(task, completed=trainer.step)
                if trainer.step % config.judge_every == 0 or trainer.step == config.steps:
                    bar.update(task, description=trainer.note(losses))
                if time.monotonic() - saved > 60 * config.save_minutes:
                    trainer.save()
                    saved = time.monotonic()
        except KeyboardInterrupt:
            bar.console.print(f"stopped at {trainer.step} batches; the same command goes on")
    trainer.save()
    return trainer.export()


class Trainer:
    """The state of one training run."""

    def __init__(self, config: PriorConfig) -> None:
        self.config, self.step = config, 0
        self._spec = catalog.load(config.robot).spec
        home = self._spec.home[self._spec.group("waist", "arms")]
        stores = [ClipSet.load(path, self._spec) for path in (config.clips, config.synthetic) if path is not None]
        if not stores:
            raise NoClips("there are no clips to learn from")
        share = config.synthetic_share
        self._sources = [Windows(store.split("train"), home) for store in stores]
        self._counts = [config.batch] if len(stores) == 1 else [config.batch - round(share * config.batch), round(share * config.batch)]
        self._held_out = Windows(stores[0].split("val"), home)
        self._minutes = [store.split("train").seconds / 60 for store in stores]
        self.model = PriorModel(self._spec, config.shape)
        self._optimiser = torch.optim.AdamW(self.model.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay)

    def resume(self) -> None:
        """Continue from the run's checkpoint if there is one, else take the normalisation from the training windows."""
        config, path = self.config, self.config.run / "checkpoint.pt"
        config.run.mkdir(parents=True, exist_ok=True)
        if path.exists():
            self._compare()
            state = torch.load(path, weights_only=True)
            self.model.load_state_dict(state["model"])
            self._optimiser.load_state_dict(state["optimiser"])
            torch.set_rng_state(state["random"])
            self.step = int(state["step"])
            return
        (config.run / "config.json").write_text(json.dumps(_plain(config) | {"commit": commit()}, indent=1) + "\n")
        counts = [FIT_WINDOWS * count // config.batch for count in self._counts]
        left_out = self.model.fit(*self._draw(counts))
        print(f"the curves leave out {left_out[0]:.2%} of the past's variance and {left_out[1]:.2%} of the future's")

    def iterate(self) -> dict[str, float]:
        """One batch; the terms of its loss."""
        config, done = self.config, self.step / self.config.steps
        for group in self._optimiser.param_groups:
            group["lr"] = config.learning_rate * max(0.01, 0.5 * (1 + math.cos(math.pi * done))) * min(1.0, self.step / 200 + 0.01)
        beta = config.terms.beta * min(1.0, done / config.terms.warm_up) if config.terms.warm_up else config.terms.beta
        loss, parts = elbo(self.model, *self._draw(self._counts), config.terms, beta)
        self._optimiser.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.model.parameters(), 10.0)
        self._optimiser.step()
        self.step += 1
        return parts | {"beta": beta}

    def note(self, losses: dict[str, float]) -> str:
        """Write a row of the curve; a short text for the progress bar."""
        errors = judge(self.model, self._held_out, stride=25)
        row = {"step": self.step} | losses | {f"{name} {seconds}": error.rms for (name, seconds), error in errors.items()}
        path, fresh = self.config.run / "curve.csv", not (self.config.run / "curve.csv").exists()
        with path.open("a", newline="") as file:
            writer = csv.DictWriter(file, row)
            if fresh:
                writer.writeheader()
            writer.writerow(row)
        return f"prior  KL {losses['kl']:.1f}  R at 0.5 s {errors['R', 0.5].rms:.3f} (hold {errors['hold', 0.5].rms:.3f}) rad"

    def save(self) -> None:
        """Write the checkpoint so that a crash leaves the old one or the new one."""
        path = self.config.run / "checkpoint.pt"
        state = {"model": self.model.state_dict(), "optimiser": self._optimiser.state_dict(), "random": torch.get_rng_state()}
        aside = path.with_suffix(".part")
        torch.save(state | {"step": self.step}, aside)
        aside.replace(path)

    def export(self) -> Path:
        """Write weights and card for `Prior`."""
        config, path = self.config, self.config.run / f"prior_{self.config.robot}.safetensors"
        errors = judge(self.model, self._held_out, stride=10)
        card = {
            "kind": KIND,
            "name": path.stem,
            "robot": config.robot,
            "joints": list(self._spec.motor_names[self._spec.group("waist", "arms")]),
            "window": WINDOW,
            "shape": asdict(config.shape),
            "terms": asdict(config.terms),
            "steps": self.step,
            "batch": config.batch,
            "seed": config.seed,
            "commit": commit(),
            "training_minutes": [round(minutes, 1) for minutes in self._minutes],
            "validation_rms_rad": {f"{name} {seconds} s": round(error.rms, 4) for (name, seconds), error in errors.items()},
            "validation_mean_rad": {f"{name} {seconds} s": round(error.mean, 4) for (name, seconds), error in errors.items()},
        }
        checkpoint.save(path, self.model.state_dict(), card)
        return path

    def _compare(self) -> None:
        """Refuse to go on with another configuration than the run began with."""
        began, now = json.loads((self.config.run / "config.json").read_text()), _plain(self.config)
        changed = [name.replace("_", " ") for name in now if name not in FREE and began.get(name) != now[name]]
        if changed:
            raise OtherTraining(self.config.run, changed)

    def _draw(self, counts: Iterable[int]) -> tuple[Tensor, Tensor]:
        drawn = [source.sample(count, self.config.variation) for source, count in zip(self._sources, counts, strict=True)]
        return torch.cat([past for past, _ in drawn]), torch.cat([future for _, future in drawn])


def _plain(config: PriorConfig) -> dict[str, object]:
    """The configuration as JSON holds it."""
    return json.loads(json.dumps(asdict(config), default=str))


def elbo(model: PriorModel, history: Tensor, future: Tensor, terms: Terms, beta: float) -> tuple[Tensor, dict[str, float]]:
    """Negative evidence lower bound a window (with the extra terms of `Terms`) and its parts, nats.

    Args:
        history: M0 [n, WINDOW, 15], rad.
        future: M1 [n, WINDOW, 15], rad.
    """
    seen, coming = model.see(history), model.foresee(history, future)
    prior, encoder = model.prior(seen), model.encoder(seen, coming)
    divergence = encoder.divergence(prior).mean(0)
    shown = _hide(seen, terms.hidden_past)
    both = model.forecast(torch.cat([encoder.sample(), prior.mean]), shown.repeat(2, 1, 1))
    error = (both - coming.repeat(2, 1, 1)) * model.future.scale
    rebuilt, forecast = ((torch.sqrt(error**2 + SOFT**2) - SOFT).sum((-1, -2)) / SPREAD).view(2, -1).mean(1)
    loss = rebuilt + terms.from_prior * forecast + beta * divergence.clamp(min=terms.free_nats).sum()
    parts = {"rebuilt": rebuilt, "forecast": forecast, "kl": divergence.sum(), "used": (divergence > 0.05).sum().float()}
    return loss, {name: float(part.detach()) for name, part in parts.items()}


def _hide(seen: Tensor, share: float) -> Tensor:
    """Leave only the last pose in a share of the samples."""
    shown = (torch.rand(len(seen), 1, 1) >= share).float()
    return torch.cat([seen[:, :1], shown * seen[:, 1:]], 1)
