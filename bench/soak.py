"""`teleop-bench soak`: a server of its own, driven and recorded for a quarter of an hour, watched and flooded: does anything grow?"""

from __future__ import annotations

import asyncio
import json
import time
import urllib.request
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from websockets.asyncio.client import connect
from websockets.exceptions import WebSocketException
from websockets.typing import Origin

from bench import drive
from bench.stream import server
from policies.commit import commit

SAMPLE = 5.0
"""Seconds between two looks at the processes."""
WARM_UP = 0.2
"""Share of the time after which memory should have settled."""
FLOOD = ('{"seq": 1}', '{"seq": 2, "height": NaN}', '{"seq": 3, "unknown": 1}', "{" * 60, '{"seq": 4, "name": "' + "x" * 50_000 + '"}')
"""What a flooding client sends over and over."""


@dataclass(frozen=True)
class SoakBench:
    """Drive, record, watch and flood a server of its own, and see what grows.

    Example: teleop-bench soak --minutes 15 --watchers 8 --json soak.json
    """

    minutes: float = 15.0
    """How long."""
    watchers: int = 8
    """Pages that watch (they take in the whole scene and draw nothing)."""
    flooders: int = 2
    """Clients that send rubbish, more than they may, and come back when they are closed."""
    record: bool = True
    """Record an episode meanwhile. The index of a recording stays in memory until its file is closed."""
    policy: str = "walk_h1"
    """Shipped weights by name, or a .safetensors file."""
    json: Path | None = None
    """Also write the figures to this file."""


@dataclass
class Process:
    """One process over time."""

    pid: int
    seconds: list[float] = field(default_factory=list)
    megabytes: list[float] = field(default_factory=list)
    """What it took for itself: anonymous memory, which other programs with the same libraries do not change."""
    shares: list[float] = field(default_factory=list)
    """Its share of all memory that it uses (PSS) [MB]."""
    handles: list[int] = field(default_factory=list)
    """Open file handles."""

    def look(self, now: float) -> None:
        """One more sample."""
        folder = Path(f"/proc/{self.pid}")
        fields = (line.split() for line in (folder / "smaps_rollup").read_text().splitlines()[1:])
        kilobytes = {words[0]: int(words[1]) for words in fields}
        self.seconds.append(now)
        self.megabytes.append(kilobytes["Pss_Anon:"] / 1024)
        self.shares.append(kilobytes["Pss:"] / 1024)
        self.handles.append(sum(1 for _ in (folder / "fd").iterdir()))

    def summary(self) -> dict[str, float]:
        """Memory and handles at the end, and what they grew by since the warm-up."""
        settled = np.array(self.seconds) >= WARM_UP * self.seconds[-1]
        seconds, megabytes, handles = (np.array(values)[settled] for values in (self.seconds, self.megabytes, self.handles))
        slope = float(np.polyfit(seconds, megabytes, 1)[0]) if len(seconds) > 2 else float("nan")
        return {
            "pss_megabytes": self.shares[-1],
            "own_megabytes": float(megabytes[-1]),
            "own_megabytes_per_10_minutes": 600 * slope,
            "handles": int(handles[-1]),
            "handles_grown": float(np.median(handles[-5:]) - np.median(handles[:5])),
        }


def run(config: SoakBench) -> dict:
    """Soak, then print and return the figures."""
    with server(config.policy) as (address, pid):
        processes = {"web": Process(pid), "simulation": Process(_simulation(pid))}
        id = _ask(address, "POST", "/api/episodes", {"label": "soak"})["id"] if config.record else None
        log, sent = asyncio.run(_soak(config, address, processes))
        episode = _ask(address, "POST", f"/api/episodes/{id}/stop", {}) if id else {"rows": 0, "missing": 0}
    driven = drive.summarise(log, _driving(config, address))
    kept = ("falls_and_faults", "holds", "real_time_factor", "missed_share", "lateness_p99_ms", "kilobytes_a_second_a_watcher", "scheduler")
    figures = {name: driven[name] for name in kept}
    figures["lateness_p99_worst_ms"] = max(record["lateness_ms"]["p99"] for record in log.records)
    figures |= {"refused": log.records[-1]["rejected"], "flooded": sent, "rows": episode["rows"], "rows_missing": episode["missing"]}
    figures |= {name: process.summary() for name, process in processes.items()}
    figures |= {"commit": commit(), "policy": config.policy}
    title = f"{config.minutes:g} minutes, {config.watchers} pages watching, {config.flooders} clients flooding"
    table = Table(title=title, show_header=False)
    for name, value in figures.items():
        for part, number in value.items() if isinstance(value, dict) else [("", value)]:
            table.add_row(f"{name} {part}".replace("_", " "), f"{number:.4g}" if isinstance(number, float) else str(number))
    Console().print(table)
    if config.json:
        config.json.write_text(json.dumps(figures, indent=1) + "\n")
    return figures


def _driving(config: SoakBench, address: str) -> drive.DriveBench:
    return drive.DriveBench(url=f"http://{address}", minutes=config.minutes, watchers=config.watchers)


async def _soak(config: SoakBench, address: str, processes: dict[str, Process]) -> tuple[drive.Log, int]:
    sent: list[int] = []
    beside = [asyncio.create_task(_flood(address, sent.append)) for _ in range(config.flooders)]
    beside.append(asyncio.create_task(_look(list(processes.values()))))
    try:
        log = await drive.script(_driving(config, address))
    finally:
        for task in beside:
            task.cancel()
        await asyncio.gather(*beside, return_exceptions=True)
    return log, len(sent)


async def _look(processes: list[Process]) -> None:
    began = time.monotonic()
    while True:
        for process in processes:
            process.look(time.monotonic() - began)
        await asyncio.sleep(SAMPLE)


async def _flood(address: str, sent: Callable[[int], None]) -> None:
    """Send rubbish at 300 messages a second, read nothing, and come back a second after being closed."""
    while True:
        with suppress(OSError, WebSocketException):
            async with connect(f"ws://{address}/api/operator", origin=Origin(f"http://{address}"), compression=None) as socket:
                for number in range(100_000):
                    await socket.send(FLOOD[number % 3 if (number + 1) % 500 else 3 + number // 500 % 2])
                    sent(number)
                    await asyncio.sleep(1 / 300)
        await asyncio.sleep(1.0)


def _simulation(pid: int) -> int:
    """The simulation process of a server."""
    pids = [int(child) for task in Path(f"/proc/{pid}/task").iterdir() for child in (task / "children").read_text().split()]
    return next(pid for pid in pids if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes())


def _ask(address: str, method: str, path: str, body: dict) -> dict:
    headers = {"Content-Type": "application/json"}
    request = urllib.request.Request(f"http://{address}{path}", json.dumps(body).encode(), headers, method=method)
    with urllib.request.urlopen(request, timeout=30) as answer:
        return json.load(answer)
