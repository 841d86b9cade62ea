"""`teleop-train retarget`: a folder of human motion becomes one file of clips for the robot."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from policies.motion import bvh, g1
from policies.motion.clip import Clip, ClipSet
from policies.motion.errors import MotionError, UnreadableMotion
from policies.motion.human import elbow_side, observe
from policies.motion.labels import Labels, guess, kind, read_index, sources
from policies.motion.person import Person
from policies.motion.retarget import CUTOFF, Retargeted, Retargeter
from policies.motion.skeleton import MissingJoints
from policies.motion.unfinished import Unfinished
from robots import catalog
from robots.catalog import Robot

SHORTEST = 1.0
"""Clips below this are skipped [s]."""


class NoMotion(MotionError):
    """A folder in which nothing could be used."""

    def __init__(self, folder: Path, reason: str) -> None:
        super().__init__(f"{folder}: {reason}; give a folder of .bvh files (CMU, ACCAD or alike) or G1 motions as .csv, plain or .gz")


@dataclass(frozen=True)
class RetargetConfig:
    """Turn human motion into clips for the robot's waist and arms.

    Example: teleop-train retarget --clips motions/ --out runs/clips.npz

    The same command again goes on where it was stopped.
    """

    clips: Path
    """Folder of .bvh, .bvh.gz, .csv or .csv.gz files, searched with its subfolders; an index CSV in it gives subject and split."""
    out: Path = Path("runs/clips.npz")
    """File to write."""
    robot: str = "h1"
    """Robot to retarget to."""
    about: str = ""
    """Source and terms of the motions, kept in the file."""


@dataclass(frozen=True)
class Outcome:
    """What became of one file: a clip and its report, or the reason why not."""

    path: Path
    clip: Clip | None = None
    report: Retargeted | None = None
    reason: str = ""


def retarget(config: RetargetConfig) -> ClipSet:
    """Retarget every motion in a folder, write the clips, print what was kept and what was not.

    Raises:
        NoMotion: the folder is missing or holds no motion that can be used.
        UnknownRobot: no such robot.
    """
    console = Console()
    robot = catalog.load(config.robot)
    if not config.clips.is_dir():
        raise NoMotion(config.clips, "is not a folder")
    files = sources(config.clips)
    index = read_index(config.clips)
    sides = _calibrate(track(files, "reading skeletons", console=console))
    worker, parts = Retargeter(robot), Unfinished(config.out, config.robot)
    rate = robot.spec.policy_rate
    outcomes = [_one(path, index, sides, worker, parts, rate) for path in track(files, "retargeting", console=console)]
    outcomes += [Outcome(path, reason="in the index, but there is no such file") for path in index if not path.exists()]
    kept = ClipSet.of(robot.spec, (outcome.clip for outcome in outcomes if outcome.clip), config.about)
    _tell(console, outcomes)
    if not len(kept):
        raise NoMotion(config.clips, "no motion in it could be used")
    kept.save(config.out)
    parts.done()
    console.print(f"{len(kept)} clips, {kept.seconds / 60:.1f} minutes -> {config.out}")
    return kept


def retarget_file(path: Path, robot: Robot) -> Clip:
    """The clip of one motion file. The side to which elbows bend is seen in this file alone.

    Raises:
        UnreadableMotion: it is damaged, lacks a joint, is too short or too slow.
    """
    outcome = _one(path, {}, _calibrate([path]), Retargeter(robot), None, robot.spec.policy_rate)
    if outcome.clip is None:
        raise UnreadableMotion(path, outcome.reason)
    return outcome.clip


def _skeleton(motion: bvh.Bvh) -> tuple:
    """What two files must share for their elbows to bend the same way: joint names and the arm bones' directions."""
    return motion.names, tuple(np.round(motion.offsets[1:] / np.abs(motion.offsets[1:]).max(), 2).ravel())


def _calibrate(files: Iterable[Path]) -> dict[tuple, np.ndarray]:
    """Side to which the elbows bend, by skeleton, from all its files; unusable files are named later."""
    sides: defaultdict[tuple, np.ndarray] = defaultdict(lambda: np.zeros((2, 3)))
    for path in files:
        if kind(path) == "bvh":
            try:
                motion = bvh.read(path)
                sides[_skeleton(motion)] += elbow_side(motion)
            except (UnreadableMotion, MissingJoints):
                continue
    return sides


def _one(
    path: Path, index: dict[Path, Labels], sides: dict[tuple, np.ndarray], worker: Retargeter, parts: Unfinished | None, rate: float
) -> Outcome:
    labels, made = index.get(path.resolve()) or guess(path), parts and parts.find(path)
    if made is None:
        try:
            person = _person(path, sides)
        except (UnreadableMotion, MissingJoints) as error:
            return Outcome(path, reason=error.reason if isinstance(error, UnreadableMotion) else str(error))
        if person.frames / person.rate < SHORTEST:
            return Outcome(path, reason=f"only {person.frames / person.rate:.2f} s long")
        if person.rate < 3 * CUTOFF:
            return Outcome(path, reason=f"only {person.rate:.0f} frames a second")
        made = worker(person)
        if parts:
            parts.keep(path, made)
    return Outcome(path, Clip(rate=rate, q=made.q, twist=made.twist, height=made.height, **vars(labels)), made)


def _person(path: Path, sides: dict[tuple, np.ndarray]) -> Person:
    if kind(path) == "csv":
        return g1.read(path)
    motion = bvh.read(path)
    return observe(motion, sides[_skeleton(motion)])


def _tell(console: Console, outcomes: list[Outcome]) -> None:
    table = Table(
        title="retargeted",
        caption="clipped: beyond a joint limit; mended: by inverse kinematics; cleared: moved out of the body; then mean wrist errors",
    )
    for column in ("category", "train", "val", "minutes", "clipped", "mended", "cleared", "closed form", "person"):
        table.add_column(column, justify="left" if column == "category" else "right")
    by: defaultdict[str, list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        if outcome.clip:
            by[outcome.clip.category].append(outcome)
    for category, members in sorted(by.items()):
        table.add_row(category, *_cells(members))
    everything = [outcome for members in by.values() for outcome in members]
    if everything:
        table.add_section()
        table.add_row("all", *_cells(everything))
    console.print(table)
    for outcome in outcomes:
        if not outcome.clip:
            console.print(f"[yellow]skipped[/] {outcome.path.name}: {outcome.reason}", highlight=False, soft_wrap=True)
    if outcomes and not any(outcome.clip and outcome.clip.split == "val" for outcome in outcomes):
        console.print("[yellow]no clip is for validation[/]: an index CSV with the columns file and split can name some")


def _cells(members: list[Outcome]) -> list[str]:
    clips = [outcome.clip for outcome in members if outcome.clip]
    reports = [outcome.report for outcome in members if outcome.report]
    weight = np.array([len(report.q) for report in reports], dtype=float)
    splits = Counter(clip.split for clip in clips)

    def mean(field: str) -> float:
        return float(np.average([getattr(report, field) for report in reports], weights=weight))

    return [
        str(splits["train"]),
        str(splits["val"]),
        f"{sum(clip.seconds for clip in clips) / 60:.1f}",
        f"{mean('clipped'):.1%}",
        f"{mean('mended'):.1%}",
        f"{mean('moved_clear'):.1%}",
        f"{1000 * mean('wrist_error'):.0f} mm",
        f"{1000 * mean('human_error'):.0f} mm",
    ]
