"""`teleop-bench drive`: a scripted operator drives a running server for minutes while others watch."""

from __future__ import annotations

import asyncio
import json
import math
import sys
import time
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import WebSocketException
from websockets.typing import Origin

from bench.page import watch
from policies.commit import commit

ROUND: tuple[tuple[str, float, tuple[float, float, float]], ...] = (
    ("stand", 6.0, (0.0, 0.0, 0.0)),
    ("forward", 6.0, (0.5, 0.0, 0.0)),
    ("turn", 4.0, (0.0, 0.0, 0.5)),
    ("sideways", 4.0, (0.0, 0.3, 0.0)),
    ("curve", 6.0, (0.4, 0.0, -0.4)),
    ("back", 4.0, (-0.3, 0.0, 0.0)),
)
"""Name, seconds, vx [m/s], vy [m/s], yaw rate [rad/s]."""
PERIOD = 0.05
"""Seconds between two messages."""
REACH = 0.10
"""Half-width of the wrists' figure [m]."""
STILL = 2.0
"""Wrists stand still for the last seconds of `stand`, so that their error can be read."""
STILL_AT = 2.0
"""Where on the figure [s]."""


@dataclass(frozen=True)
class DriveBench:
    """Drive a running `teleop` by script: stand, walk, turn, sidestep, both arms reaching.

    Example: teleop & teleop-bench drive --minutes 10 --watchers 4
    """

    url: str = "http://127.0.0.1:8080"
    """Where the server is."""
    minutes: float = 10.0
    """How long to drive."""
    watchers: int = 4
    """Pages that watch meanwhile (they take in the whole scene and draw nothing)."""
    json: Path | None = None
    """Also write the figures to this file."""


@dataclass
class Log:
    """What the answers said."""

    records: list[dict] = field(default_factory=list)
    still: list[tuple[float, float]] = field(default_factory=list)
    """Errors of wrists that stand still at reachable targets [m, degrees]."""
    watched: list[int] = field(default_factory=list)
    """Bytes of every message that the watchers took in."""


def run(config: DriveBench) -> dict:
    """Drive, then print and return the figures."""
    try:
        log = asyncio.run(script(config))
    except (OSError, WebSocketException) as error:
        sys.exit(f"teleop-bench: no server answers at {config.url} ({error}); start one with `make run`")
    figures = summarise(log, config)
    table = Table(title=f"{config.minutes:g} minutes, {config.watchers} pages watching", show_header=False)
    for name, value in figures.items():
        table.add_row(name.replace("_", " "), f"{value:.4g}" if isinstance(value, float) else str(value))
    Console().print(table)
    if config.json:
        config.json.write_text(json.dumps(figures, indent=1) + "\n")
    return figures


def summarise(log: Log, config: DriveBench) -> dict:
    """Figures of a whole drive from the health records."""
    first, last = log.records[0], log.records[-1]
    ticks, missed = last["ticks"] - first["ticks"], last["missed"] - first["missed"]
    faults = sum(now["state"] == "FAULT" != before["state"] for before, now in pairwise(log.records))
    wall = last["wall"] - first["wall"]
    errors = np.array(log.still) if log.still else np.full((1, 2), np.nan)
    return {
        "falls_and_faults": faults,
        "holds": sum(now["state"] == "HOLD" != before["state"] for before, now in pairwise(log.records)),
        "real_time_factor": (last["time"] - first["time"]) / wall,
        "missed_share": missed / max(ticks + missed, 1),
        "lateness_p99_ms": float(np.median([r["lateness_ms"]["p99"] for r in log.records])),
        "ik_p50_ms": float(np.median([r["ik_ms"]["p50"] for r in log.records])),
        "ik_p99_ms": float(np.median([r["ik_ms"]["p99"] for r in log.records])),
        "wrist_error_mm": 1e3 * float(errors[:, 0].mean()),
        "wrist_error_degrees": float(errors[:, 1].mean()),
        "rejected": last["rejected"] - first["rejected"],
        "answers": len(log.records),
        "kilobytes_a_second_a_watcher": sum(log.watched) / 1e3 / wall / max(config.watchers, 1),
        "scheduler": last["scheduler"],
        "commit": commit(),
        "policy": last["policy"],
    }


async def script(config: DriveBench) -> Log:
    """Drive a running server while pages watch."""
    address, log = urlsplit(config.url).netloc, Log()
    async with connect(f"ws://{address}/api/operator", origin=Origin(f"http://{address}"), compression=None) as operator:
        watchers = [asyncio.create_task(watch(address, log.watched.append)) for _ in range(config.watchers)]
        try:
            await _operate(operator, config, log)
        finally:
            for task in watchers:
                task.cancel()
            await asyncio.gather(*watchers, return_exceptions=True)
    return log


async def _operate(operator: ClientConnection, config: DriveBench, log: Log) -> None:
    home = json.loads(await operator.recv())["wrists"]
    listener = asyncio.create_task(_listen(operator, log))
    began, seq = time.monotonic(), 0
    with Progress(transient=True) as progress:
        task = progress.add_task("driving", total=60 * config.minutes)
        while (now := time.monotonic() - began) < 60 * config.minutes and not listener.done():
            phase, left, twist = _phase(now)
            still = phase == "stand" and left < STILL
            pressed = now > 0.5 and not (log.records and log.records[-1]["state"] == "HOLD" and seq % 10 == 0)  # let go, press again
            message = {"seq": seq, "name": "bench", "engage": pressed, "twist": dict(zip(("vx", "vy", "yaw_rate"), twist, strict=True))}
            message["wrists"] = {side: _figure(home[side]["actual"], now, side, still) for side in ("left", "right")}
            await operator.send(json.dumps(message))
            if log.records and phase == "stand" and left < STILL - 1.0:
                wrists = log.records[-1]["wrists"].values()
                log.still += [_miss(wrist) for wrist in wrists if not wrist["limited_by"]]
            progress.update(task, completed=now, description=phase)
            seq += 1
            await asyncio.sleep(PERIOD)
    listener.cancel()
    await operator.send(json.dumps({"seq": seq, "engage": False, "twist": {"vx": 0.0, "vy": 0.0, "yaw_rate": 0.0}}))


async def _listen(operator: ClientConnection, log: Log) -> None:
    async for message in operator:
        log.records.append(json.loads(message) | {"wall": time.monotonic()})


def _phase(now: float) -> tuple[str, float, tuple[float, float, float]]:
    """Name, seconds left and twist of the phase at time now [s]."""
    now %= sum(seconds for _, seconds, _ in ROUND)
    for name, seconds, twist in ROUND:
        if now < seconds:
            return name, seconds - now, twist
        now -= seconds
    raise AssertionError("time does not end")


def _figure(home: dict, now: float, side: str, still: bool) -> dict:
    """A wrist pose on a figure of eight around home; still targets are a point of it that both arms reach as they are turned."""
    angle = 2 * math.pi * (STILL_AT if still else now) / 5 + (0 if side == "left" else math.pi / 2)
    x, y, z = home["position"]
    offset = (REACH * math.sin(angle), 0.5 * REACH * math.sin(2 * angle), REACH * (1 + math.cos(angle)))
    return {"position": [x + offset[0], y + offset[1], z + offset[2]], "quaternion": home["quaternion"]}


def _miss(wrist: dict) -> tuple[float, float]:
    """Distance [m] and angle [degrees] between target and actual pose."""
    target, actual = wrist["target"], wrist["actual"]
    dot = abs(sum(a * b for a, b in zip(target["quaternion"], actual["quaternion"], strict=True)))
    return math.dist(target["position"], actual["position"]), math.degrees(2 * math.acos(min(1.0, dot)))
