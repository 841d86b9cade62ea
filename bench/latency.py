"""`teleop-bench latency`: how long after a drag the joint targets move, and the pose in the page."""

from __future__ import annotations

import asyncio
import json
import random
import shutil
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.table import Table
from websockets.asyncio.client import connect

from bench.stream import server
from policies.command import AT
from policies.commit import commit
from policies.recording.reader import Recording

if TYPE_CHECKING:
    from playwright.sync_api import Page

WRIST_X = AT["wrists"].start
"""Where the left wrist's x stands in a row's `raw`."""
SPREAD = 0.03
"""Half-width of the drags [m]."""
PAUSE = (0.12, 0.22)
"""Between two drags, at random, so that they meet the ticks at every phase [s]."""
AIMS = {"joint target": 60.0, "pose in the page": 110.0}
"""p95 [ms]."""
CHROMIUM = ("chromium", "chromium-browser", "google-chrome")
FLAGS = ("--no-sandbox", "--disable-gpu", "--disable-background-networking", "--enable-unsafe-swiftshader")
OWN_FRAMES = """window.requestAnimationFrame = (draw) =>
  draw.name === "draw" ? setTimeout(() => draw(performance.now()), 1000 / 60) : 0"""
"""60 times a second web/stage.js hands poses to viser, which draws nothing: without a graphics processor a machine would do nothing
else, and the figure would be that of its drawing. A screen adds its own frame, 8 ms on average at 60 Hz."""
PATIENCE = 120.0
"""For all drags in the page [s]."""
DRAG = """x => {
  const { handle, pose } = window.drags;
  const position = [x, ...pose.position.slice(1)], wxyz = pose.quaternion;
  window.teleopTap.tell("sent", { type: "TransformControlsUpdateMessage", name: handle, position, wxyz });
  return (performance.timeOrigin + performance.now()) / 1e3;
}"""
"""What viser tells the page while a handle is dragged."""


@dataclass(frozen=True)
class LatencyBench:
    """Drag a wrist of a server of its own: by a script, then in the real page in Chromium. Both clocks are this machine's."""

    drags: int = 150
    """How often."""
    policy: str = "walk_h1"
    """Leg weights."""
    json: Path | None = None
    """Also write the figures to this file."""


def run(config: LatencyBench) -> dict:
    """Measure, then print and return the figures [ms]."""
    with server(config.policy) as (address, _):
        figures: dict[str, Any] = {"script": asyncio.run(_scripted(address, config.drags))}
        page = _paged(address, config.drags)
        if page:
            figures["page"] = page
    figures["commit"] = commit()
    _print(figures)
    if config.json:
        config.json.write_text(json.dumps(figures, indent=1) + "\n")
    return figures


def _print(figures: dict) -> None:
    table = Table("from a drag to", "p50 (ms)", "p95 (ms)", "aim", "drags")
    for way in ("script", "page"):
        for end, values in figures.get(way, {}).get("to", {}).items():
            row = [f"{values['p50']:.1f}", f"{values['p95']:.1f}", f"{AIMS[end]:g}", str(values["drags"])]
            table.add_row(f"{end} ({'by a script' if way == 'script' else 'in the page'})", *row)
    Console().print(table)
    stages = figures.get("page", figures["script"])["stages"]
    told = ", ".join(f"{name} {value:.1f}" for name, value in stages.items() if value is not None)
    Console().print(f"stages (ms): {told}")


async def _scripted(address: str, drags: int) -> dict:
    """Drags said by a client of the operator's socket, which is no page."""
    sent: list[tuple[float, float]] = []
    async with connect(f"ws://{address}/api/operator", compression=None) as operator:
        home = json.loads(await operator.recv())["wrists"]["left"]["actual"]
        drain = asyncio.create_task(_ignore(operator))
        seq, engaged_at = 0, time.monotonic() + 0.5

        async def say(**fields: Any) -> None:
            nonlocal seq
            seq += 1
            await operator.send(json.dumps({"seq": seq, "name": "bench", "engage": time.monotonic() > engaged_at, **fields}))

        with _recorded(address) as rows:
            while len(sent) < drags:
                pause = time.monotonic() + random.uniform(*PAUSE)
                while time.monotonic() < pause:
                    await say()
                    await asyncio.sleep(0.03)
                if time.monotonic() < engaged_at + 0.3:
                    continue
                x = home["position"][0] + random.uniform(-SPREAD, SPREAD)
                sent.append((x, time.time()))
                await say(wrists={"left": {"position": [x, *home["position"][1:]], "quaternion": home["quaternion"]}})
        drain.cancel()
        ends = _ends(rows(), sent)
        return {"to": {"joint target": _percentiles([at - then for (_, then), (at, _) in ends])}, "stages": _stages(address)}


async def _ignore(socket: Any) -> None:
    async for _ in socket:
        pass


def _paged(address: str, drags: int) -> dict | None:
    """Drags in the page; None without a browser."""
    chromium = next(filter(None, map(shutil.which, CHROMIUM)), None)
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        chromium = None
    if chromium is None:
        print("no browser: the page's half is left out (pip install playwright; apt-get install chromium)", file=sys.stderr)
        return None
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=list(FLAGS))
        page = browser.new_page()
        page.add_init_script(OWN_FRAMES)
        page.goto(f"http://{address}/")
        page.wait_for_function("window.teleop?.live.frames > 20", timeout=120_000, polling=100)
        figures = _drag(page, address, drags)
        browser.close()
    return figures


def _drag(page: Page, address: str, drags: int) -> dict:
    home = _health(address)["wrists"]["left"]["actual"]
    page.evaluate(
        """async (pose) => {
          const [{ handle }] = (await (await fetch("/api/scene")).json()).wrists;
          window.drags = { handle, pose };
          window.shown = [];
          teleop.live.addEventListener("shown", ({ detail }) =>
            window.shown.push([detail.tick, (performance.timeOrigin + performance.now()) / 1e3]));
        }""",
        home,
    )
    sent: list[tuple[float, float]] = []
    until = time.monotonic() + PATIENCE
    with _recorded(address) as rows:
        while len(sent) < drags and time.monotonic() < until:
            if page.locator("#engage.on").count() == 0:
                page.keyboard.press("Space")
                time.sleep(0.5)
                continue
            x = home["position"][0] + random.uniform(-SPREAD, SPREAD)
            sent.append((x, page.evaluate(DRAG, x)))
            time.sleep(random.uniform(*PAUSE))
        stages = _stages(address)
    shown = np.array(page.evaluate("window.shown"))
    ends = _ends(rows(), sent)
    poses = [shown[shown[:, 0] >= tick, 1][:1] - then for (_, then), (_, tick) in ends]
    targets = _percentiles([at - then for (_, then), (at, _) in ends])
    return {"to": {"joint target": targets, "pose in the page": _percentiles(np.concatenate(poses))}, "stages": stages}


def _ends(rows: np.ndarray, sent: list[tuple[float, float]]) -> list[tuple[tuple[float, float], tuple[float, int]]]:
    """Each drag whose wish reached the joint targets, with the time and the number of that tick.

    A row is dated at the end of its tick; its joint targets were there before the physics of the tick.
    """
    moved = np.any(rows["ctrl"][1:] != rows["ctrl"][:-1], axis=1)
    ends = []
    for drag in sent:
        (hits,) = np.nonzero((np.abs(rows["raw"][1:, WRIST_X] - drag[0]) < 1e-9) & moved)
        if len(hits):
            row = rows[hits[0] + 1]
            ends.append((drag, (float(row["wall"]), int(row["tick"]))))
    return ends


def _percentiles(seconds: Any) -> dict:
    p50, p95 = np.percentile(seconds, [50, 95]) * 1e3
    return {"p50": float(p50), "p95": float(p95), "drags": len(seconds)}


@contextmanager
def _recorded(address: str) -> Iterator[Callable[[], np.ndarray]]:
    """Record what happens meanwhile; afterwards the value returns all rows."""
    taken: list[np.ndarray] = []
    id = _ask(address, "/api/episodes", "POST")["id"]
    yield lambda: taken[0]
    time.sleep(0.3)
    _ask(address, f"/api/episodes/{id}/stop", "POST")
    with tempfile.NamedTemporaryFile(suffix=".mcap") as file:
        with urllib.request.urlopen(f"http://{address}/api/episodes/{id}/download") as answer:
            shutil.copyfileobj(answer, file)
        file.flush()
        with Recording(Path(file.name)) as recording:
            taken.append(next(recording.episodes()).rows)


def _stages(address: str) -> dict:
    return _health(address)["latency_ms"]


def _health(address: str) -> dict:
    return _ask(address, "/api/health")


def _ask(address: str, path: str, method: str = "GET") -> Any:
    with urllib.request.urlopen(urllib.request.Request(f"http://{address}{path}", method=method), timeout=30) as answer:
        return json.load(answer)
