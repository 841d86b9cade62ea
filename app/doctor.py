"""`teleop doctor`: is this machine fit to drive the robot, and what to do where it is not."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from rich.console import Console
from rich.table import Table

from app.config import Serve
from robots import catalog

Verdict = Literal["good", "poor", "bad"]
"""poor: the program runs, worse than it could. bad: it does not."""
ROOM = 2 << 30
"""Free disk below which the doctor worries [bytes]; ten minutes of recording take about 75 MB."""
SLOW_TICK = 5e-3
"""A bare tick of physics beyond this leaves too little of the 20 ms [s]."""
SLOW_DISK = 1.0
"""A megabyte that takes longer raises the alarm while recording [s]."""
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "firefox")


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at."""

    what: str
    verdict: Verdict
    found: str
    advice: str = ""


def main(robot: str = Serve.robot, port: int = Serve.port, recordings: Path = Serve.recordings) -> int:
    """Look at everything and print it. Returns 1 when something keeps the program from running."""
    findings = list(examine(robot, port, recordings))
    table = Table(box=None)
    for heading in ("", "what", "found", "advice"):
        table.add_column(heading, overflow="fold")
    colours = {"good": "green", "poor": "yellow", "bad": "red"}
    for finding in findings:
        table.add_row(f"[{colours[finding.verdict]}]{finding.verdict}[/]", finding.what, finding.found, finding.advice)
    Console(width=None if sys.stdout.isatty() else 160).print(table)
    return int(any(finding.verdict == "bad" for finding in findings))


def examine(robot: str, port: int, recordings: Path) -> Iterable[Finding]:
    """Every finding, the cheap ones first."""
    looks: tuple[Callable[[], Finding], ...] = (
        _python,
        _processors,
        _scheduling,
        lambda: _port(port),
        lambda: _disk(recordings),
        _browser,
        lambda: _meshes(robot),
        lambda: _physics(robot),
        _rendering,
    )
    for look in looks:
        try:
            yield look()
        except Exception as error:  # a machine can be broken in more ways than this file knows
            yield Finding(getattr(look, "__name__", "check").strip("_<>"), "bad", repr(error), "report it with this line")


def _weigh(what: str, fine: bool, found: str, advice: str) -> Finding:
    return Finding(what, "good", found) if fine else Finding(what, "poor", found, advice)


def _python() -> Finding:
    found = ".".join(map(str, sys.version_info[:3]))
    return Finding("python", "good", found) if sys.version_info >= (3, 11) else Finding("python", "bad", found, "install 3.11 or newer")


def _processors() -> Finding:
    count, load = os.cpu_count() or 1, os.getloadavg()[0]
    if count < 2:
        return Finding("processors", "poor", f"{count}", "the loop and the web side want one each")
    return _weigh("processors", load < count - 0.5, f"{count}, load {load:.1f}", "end what keeps them busy")


def _scheduling() -> Finding:
    """Tried in a process of its own, because it cannot be taken back."""
    command = [sys.executable, "-c", "from app.child import hurry; print(hurry())"]
    got = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout.strip()
    advice = "for ticks within 2 ms allow SCHED_FIFO: a line `YOU - rtprio 10` in /etc/security/limits.conf"
    return _weigh("scheduling", got == "fifo", got, advice)


def _port(port: int) -> Finding:
    try:
        with socket.create_server(("127.0.0.1", port)):
            return Finding("port", "good", f"{port} is free")
    except OSError as error:
        return Finding("port", "bad", f"{port}: {error.strerror}", "stop what uses it, or choose another one with --port")


def _disk(recordings: Path) -> Finding:
    folder = next(path for path in (recordings.absolute(), *recordings.absolute().parents) if path.is_dir())
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            began = time.monotonic()
            file.write(bytes(1 << 20))
            file.flush()
            os.fsync(file.fileno())
            took = time.monotonic() - began
    except OSError as error:
        return Finding("disk", "bad", f"{folder}: {error.strerror}", "choose another folder with --recordings")
    free = shutil.disk_usage(folder).free
    found = f"{free / 1e9:.1f} GB free in {folder}, 1 MB written in {1e3 * took:.0f} ms"
    if free < ROOM:
        return Finding("disk", "poor", found, "make room: ten minutes of recording take about 75 MB")
    return _weigh("disk", took < SLOW_DISK, found, "a disk this slow raises alarms while recording")


def _browser() -> Finding:
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    return _weigh("browser", found is not None, found or "none", "open the page from another machine, or install chromium")


def _meshes(robot: str) -> Finding:
    missing = catalog.load(robot).missing()
    return _weigh("meshes", not missing, " ".join(missing) or "all there", "the robot is shown as simple shapes")


def _physics(robot: str) -> Finding:
    from robots.plant import Plant
    from robots.target import Target

    plant = Plant(catalog.load(robot))
    home, took = Target(plant.spec.home), []
    plant.reset()
    for _ in range(50):
        began = time.perf_counter()
        plant.step(home)
        took.append(time.perf_counter() - began)
    tick = sorted(took)[len(took) // 2]
    return _weigh("physics", tick < SLOW_TICK, f"{1e3 * tick:.2f} ms of a tick's 20", "a faster machine, or less beside it")


def _rendering() -> Finding:
    """How exports draw; the page draws in the browser."""
    from app.exports.errors import ExportError
    from app.exports.painter import backend

    try:
        return Finding("rendering", "good", f"MUJOCO_GL={backend()}")
    except ExportError as error:
        found, _, advice = str(error).partition("; ")
        return Finding("rendering", "poor", found, advice)
