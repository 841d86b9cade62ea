"""`teleop-bench speed`: what one tick costs on this machine, part by part, and what training makes of the cores."""

from __future__ import annotations

import json
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from mjbatch import Batch
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from bench import stream
from policies.bench import reach
from policies.command import Command
from policies.commit import commit
from policies.ppo.train import Trainer, WalkConfig
from policies.prior.latent import Latent
from policies.prior.prior import Prior
from policies.walk import Learnt
from policies.whole_body import WholeBody
from robots import catalog
from robots.catalog import Robot
from robots.plant import Plant


@dataclass(frozen=True)
class SpeedBench:
    """Time IK, policy, physics and the whole tick, and training against bare physics.

    Example: teleop-bench speed --only-loop
    """

    policy: str = "walk_h1"
    """Shipped weights by name, or a .safetensors file."""
    robot: str = "h1"
    """Name in the catalog."""
    ticks: int = 1500
    """Ticks of the loop to time."""
    wakes: int = 250
    """Times that R and the leg policy are woken, 50 a second: the loop finds its caches cold."""
    only_loop: bool = False
    """Leave out hard arm targets, the stream and training, which take minutes."""
    targets: int = 200
    """Random wrist targets for the arms, a simulated second each."""
    updates: int = 4
    """Training updates to time."""
    json: Path | None = None
    """Also write the figures to this file."""


def run(config: SpeedBench) -> dict:
    """Time everything; prints tables and returns the JSON record."""
    robot, console = catalog.load(config.robot), Console()
    stages = loop(robot, config) | legs(robot, config)
    table = Table(title="one tick at 50 Hz")
    for name in ("part", "p50 ms", "p99 ms"):
        table.add_column(name, justify="right")
    for name, row in stages.items():
        table.add_row(name, f"{row['p50']:.3f}", f"{row['p99']:.3f}")
    console.print(table)
    record = {"ms": stages, "commit": commit(), "policy": config.policy}
    if not config.only_loop:
        record |= _others(robot, config, console)
    if config.json:
        config.json.write_text(json.dumps(record, indent=1) + "\n")
    return record


def _others(robot: Robot, config: SpeedBench, console: Console) -> dict:
    """What takes minutes; printed too."""
    with Progress(transient=True) as progress:
        task = progress.add_task("timing hard arm targets", total=3)
        arms = reach.measure(robot, config.targets)
        progress.update(task, advance=1, description="timing the stream")
        pages = stream.measure(config.policy)
        progress.update(task, advance=1, description="timing training")
        training = learner(robot, config)
        progress.advance(task)
    sweep = arms["ik_ms"]
    console.print(
        f"IK over {config.targets} random targets (unreachable and NaN too): p50 {sweep['p50']:.3f} ms, p99 {sweep['p99']:.3f} ms"
    )
    for count, page in pages.items():
        console.print(f"{count} pages: {100 * page['core_share']:.0f} % of a core, {page['kilobytes_a_second']:.0f} kB/s each")
    share = f"{100 * training['share']:.0f} %"
    console.print(
        f"training {training['steps_per_second']:.0f} control steps/s, {share} of bare physics ({training['bare_steps_per_second']:.0f})"
    )
    return {"arms": arms, "stream": pages, "training": training}


def loop(robot: Robot, config: SpeedBench) -> dict[str, dict[str, float]]:
    """Percentiles of each part of a tick [ms] while the robot walks and both wrists circle."""
    plant, policy = Plant(robot), WholeBody(robot, config.policy)
    state = plant.reset()
    policy.reset(state)
    home = Command()
    took: dict[str, list[float]] = {"ik": [], "policy": [], "physics": [], "tick": []}
    for tick in range(config.ticks):
        angle = 2 * np.pi * tick / 100
        wrists = home.wrists.copy()
        wrists[:, 1:3] += 0.08 * np.array([np.cos(angle), np.sin(angle)])
        command = replace(home, engage=True, twist=np.array([0.4, 0.0, 0.2]), wrists=wrists)
        began = time.perf_counter()
        target = policy.act(state, command)
        acted = time.perf_counter()
        state = plant.step(target)
        done = time.perf_counter()
        took["ik"].append(policy.trace.ik_ms)
        took["policy"].append(policy.trace.policy_ms)
        took["physics"].append(1e3 * (done - acted))
        took["tick"].append(1e3 * (done - began))
    return {name: _percentiles(times) for name, times in took.items()}


def legs(robot: Robot, config: SpeedBench) -> dict[str, dict[str, float]]:
    """Percentiles of R and the leg policy's network, over and over and when woken 50 times a second: time of one core [ms], which other
    programs do not lengthen by more than they cool its caches."""
    learnt, home = Learnt.load(robot.spec, config.policy), robot.spec.home[robot.spec.group("waist", "arms")]
    latent = Latent(robot.spec, Prior.load(learnt.prior, robot.spec) if learnt.prior else None)
    random = np.random.default_rng(0)
    observation = random.standard_normal((1, learnt.card["observation"])).astype(np.float32)
    took: dict[str, list[float]] = {"R + policy": [], "R + policy, woken": []}
    for name, count, pause in (("R + policy", config.ticks, 0.0), ("R + policy, woken", config.wakes, 1 / robot.spec.policy_rate)):
        for _ in range(count):
            upper = home[None] + 0.1 * random.standard_normal((1, len(home)))
            if pause:
                time.sleep(pause)
            began = time.thread_time()
            latent.step(upper)
            learnt.actor(observation)
            took[name].append(1e3 * (time.thread_time() - began))
    return {name: _percentiles(times) for name, times in took.items()}


def _percentiles(times: list[float]) -> dict[str, float]:
    return {"p50": float(np.percentile(times, 50)), "p99": float(np.percentile(times, 99))}


def learner(robot: Robot, config: SpeedBench) -> dict[str, float]:
    """Training's control steps a second, and those of nothing but physics, one after the other on the same cores."""
    with tempfile.TemporaryDirectory() as folder:
        trainer = Trainer(WalkConfig(run=Path(folder), robot=config.robot))
        trainer.iterate()
        rates = [trainer.iterate()["steps_per_second"] for _ in range(config.updates)]
    count = trainer.config.count
    batch = Batch(robot.model("training"), count)
    batch.reset(np.ones(count, bool), keyframe=0)
    batch.bind("ctrl")[:] = robot.spec.home[: robot.spec.body_motors]
    bare = []
    for _ in range(config.updates * 4):
        began = time.perf_counter()
        batch.step(nstep=4)
        bare.append(count / (time.perf_counter() - began))
    fast, slow = float(np.median(bare)), float(np.median(rates))
    return {"steps_per_second": slow, "bare_steps_per_second": fast, "share": slow / fast}
