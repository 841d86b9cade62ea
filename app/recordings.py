"""What `teleop episodes`, `teleop replay` and `teleop recover` do. Each prints what it finds and returns the exit code."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table
from rich.text import Text

from policies import checkpoint
from policies.episode import DamagedRecording, EpisodeInfo
from policies.recording import replay as replaying
from policies.recording import rewrite
from policies.recording.library import Library
from policies.recording.model import CannotReplay
from policies.recording.reader import Recording
from robots import catalog

if TYPE_CHECKING:
    from policies.recording.rival import Compared

FIGURES = {
    "seconds": "seconds",
    "engaged": "seconds engaged",
    "falls": "falls",
    "holds": "times the operator was lost",
    "wrist_error": "wrists, mean error [m]",
    "wrist_turn": "wrists, mean error [rad]",
    "velocity_error": "velocity, mean error [m/s]",
    "yaw_rate_error": "yaw rate, mean error [rad/s]",
    "jerk": "wrists, rms jerk [m/s^3]",
    "at_limit": "share of time with an arm at its limit",
}
"""Figures of `policies.recording.quality.Quality` as a person reads them."""


def episodes(directory: Path) -> int:
    """List the episodes of a folder. Returns 1 when a file cannot be read."""
    library = Library(directory)
    infos = library.infos()
    table = Table(box=None)
    for heading in ("episode", "date", "seconds", "rows", "label", "success", "gaps", "ended", "file"):
        table.add_column(heading, no_wrap=heading != "label")
    for info in infos:
        table.add_row(*map(Text, _cells(info)))
    width = None if sys.stdout.isatty() else 200  # whole lines for grep
    Console(width=width).print(table if infos else f"no episodes in {directory}")
    for sentence in library.damaged.values():
        _complain(sentence)
    return 1 if library.damaged else 0


def replay(file: Path, episode: int | None = None) -> int:
    """Simulate the episodes of a file again, or one of them by its number. Returns 1 when one differs from what was recorded."""
    try:
        with Recording(file) as recording:
            chosen = [info for info in recording.infos if episode in (None, info.number)]
            if not chosen:
                return _no_episode(recording, episode)
            return max([_replay(recording, info) for info in chosen])
    except (DamagedRecording, CannotReplay, OSError) as error:
        return _complain(str(error))


def rival(file: Path, policy: str, episode: int | None = None) -> int:
    """Run another policy through the episodes of a file, or one of them; print where it first differs and how both did.

    Raises:
        PolicyError, RobotError: unknown weights, or weights of another robot.
    """
    try:
        with Recording(file) as recording:
            chosen = [info for info in recording.infos if episode in (None, info.number)]
            if not chosen:
                return _no_episode(recording, episode)
            weights = str(checkpoint.find(policy, "walk"))
            robot = catalog.load(recording.metadata.robot)
            import torch  # the other commands of this file do without it

            from policies.recording.rival import compare
            from policies.whole_body import WholeBody

            torch.set_num_threads(1)
            for info in chosen:
                _tell(recording, Path(policy).stem, compare(recording, info, WholeBody(robot, weights), robot.spec))
            return 0
    except (DamagedRecording, CannotReplay, OSError, ValueError) as error:
        return _complain(str(error))


def recover(path: Path) -> int:
    """Mend a file, or every file of a folder. Returns 1 when one cannot be mended."""
    files = Library(path).files() if path.is_dir() else [path]
    return max([_recover(file) for file in files], default=0)


def _cells(info: EpisodeInfo) -> tuple[str, ...]:
    date = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(info.start))
    success = {None: "", True: "yes", False: "no"}[info.success]
    gaps = f"{info.gaps} ({info.missing} ticks)" if info.gaps else "0"
    return info.id, date, f"{info.seconds:.1f}", str(info.rows), info.label, success, gaps, info.ended, info.file.name


def _replay(recording: Recording, info: EpisodeInfo) -> int:
    done = replaying.replay(recording, info)
    verdict = "bit for bit equal" if done.diverged_at is None else f"DIFFERENT from tick {done.diverged_at} on"
    difference = f"max difference of qpos {done.max_difference:g}"
    print(f"{info.id}: {done.rows} rows, {done.segments} segments, {difference}: {verdict}")
    if recording.damaged:
        _complain(f"{recording.path} has {recording.damaged} damaged chunks, their rows were left out")
    return 0 if done.diverged_at is None else 1


def _tell(recording: Recording, policy: str, done: Compared) -> None:
    own, first = recording.metadata.policy, done.divergence
    print(f"{done.info.id}: {done.rows} rows, {done.segments} segments, recorded with {own}, run again with {policy}")
    if first is None:
        print("  no divergence: bit for bit the same")
    else:
        where = f"{first.motor}, {first.difference:.2g} rad apart"
        print(f"  first divergence at tick {first.tick}, {first.seconds:.2f} s after the start: {where}")
    if not done.after_reset:
        print("  a piece starts in the middle of a run: what the policy remembered there is not recorded, any policy differs a little")
    table = Table(box=None, padding=(0, 3))
    for heading in ("", f"recorded ({own})", policy):
        table.add_column(heading, justify="right" if heading else "left")
    for name, sentence in FIGURES.items():
        table.add_row(Text(sentence), *(f"{getattr(side, name):.4g}" for side in (done.recorded, done.other)))
    Console(width=None if sys.stdout.isatty() else 120).print(table)


def _no_episode(recording: Recording, episode: int | None) -> int:
    known = ", ".join(str(info.number) for info in recording.infos) or "none"
    return _complain(f"{recording.path} has no episode {'' if episode is None else episode}; its episodes: {known}")


def _recover(file: Path) -> int:
    try:
        done = rewrite.recover(file)
    except (DamagedRecording, rewrite.RecordingInUse, OSError) as error:
        return _complain(str(error))
    what = "recovered" if done.changed else "is complete"
    kept = f"; {done.damaged} damaged chunks, the old file is {done.original}" if done.original else ""
    print(f"{file}: {what}: {done.episodes} episodes, {done.rows} rows, {done.missing} ticks missing{kept}")
    return 0


def _complain(sentence: str) -> int:
    print(sentence, file=sys.stderr)
    return 1
