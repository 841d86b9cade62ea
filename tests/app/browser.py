"""A running `teleop`, pages in Chromium in front of it, and what a person does in them.

Drawing without a graphics processor takes all of a small machine, so pages draw nothing where nothing is dragged.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from stand_ins import eventually
from websockets.sync.client import connect

if TYPE_CHECKING:
    from playwright.sync_api import Page

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = [
    "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run",
    "--enable-unsafe-swiftshader",
]  # fmt: skip
VIEW = {"width": 300, "height": 220}
NO_PICTURES = "window.requestAnimationFrame = () => 0"
PICTURES_ON_DEMAND = """window.waiting = [];
window.requestAnimationFrame = (draw) => window.waiting.push(draw);
window.draw = () => window.waiting.splice(0).forEach((draw) => draw(performance.now()))"""
"""window.draw() draws once: a page that draws in software has time for nothing else."""
STOPWATCH = "for (const event of ['keyup', 'blur', 'pagehide']) addEventListener(event, () => (window.happened = Date.now()), true)"
"""Hears an event before the page does."""
CALM = """async () => {
  for (let calm = 0, before = performance.now(); calm < 20;) {
    await new Promise((resume) => setTimeout(resume, 50));
    const now = performance.now();
    calm = now - before < 150 ? calm + 1 : 0;
    before = now;
  }
}"""
"""Resolves when the page runs evenly: its first pictures take long to prepare."""
SOON = 0.3
"""The promise for a velocity command that nobody holds any more [s]."""
START = 60.0
"""For a busy machine to start the program or the page [s]."""


class Robot:
    """A running `teleop`."""

    def __init__(self, recordings: Path) -> None:
        self.recordings = recordings
        command = [sys.executable, "-m", "app", "--port", "0", "--recordings", os.fspath(recordings)]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        assert self._process.stdout is not None
        said = []
        for line in self._process.stdout:
            said.append(line)
            if found := re.search(r"http://\S+", line):
                self.url = found[0]
                return
        pytest.fail("teleop did not start: " + "".join(said))

    def ask(self, path: str, method: str = "GET") -> Any:
        with urllib.request.urlopen(urllib.request.Request(self.url + path, method=method), timeout=20) as answer:
            text = answer.read()
        return json.loads(text) if text else None

    @property
    def health(self) -> dict[str, Any]:
        return self.ask("/api/health")

    @property
    def vx(self) -> float:
        return self.health["command"]["vx"]

    def close(self) -> None:
        self._process.send_signal(signal.SIGTERM)
        self._process.communicate(timeout=15)


def wait(page: Page, condition: str) -> None:
    """Until a script's value is true. By the clock: Playwright's own way asks once a drawn frame, and most pages here draw none.

    Raises:
        playwright.sync_api.TimeoutError: it does not become true.
    """
    page.wait_for_function(condition, timeout=START * 1e3, polling=50)


def wait_until_connected(page: Page) -> None:
    """After opening it, or opening it again."""
    wait(page, "['STOPPED', 'HOLD', 'ENGAGED'].includes(document.querySelector('#teleop')?.dataset.state)")


def click(page: Page, selector: str) -> None:
    """Without waiting for drawn frames, as page.click would."""
    page.locator(selector).evaluate("element => element.click()")


def engage(page: Page, robot: Robot, role: str | None = None) -> None:
    """Tap Engage until the robot follows, or one role of it: a page that the machine kept from running for 200 ms is let go of, rightly."""

    def follows() -> bool:
        page.keyboard.press("Space")
        until = time.monotonic() + 1.0
        while time.monotonic() < until:
            health = robot.health
            if (health["roles"][role] if role else health)["state"] == "ENGAGED":
                return page.locator("#engage.on").count() == 1
            time.sleep(0.02)
        return False

    eventually(follows, 30)


def walk(page: Page, robot: Robot) -> None:
    """Hold W until the robot is told to walk at the pace."""

    def walks() -> bool:
        engage(page, robot)
        page.keyboard.up("w")
        page.keyboard.down("w")
        until = time.monotonic() + 1.0
        while time.monotonic() < until:
            if robot.vx > 0.49:
                return True
            time.sleep(0.02)
        return False

    eventually(walks, 60)


def stopped_within(page: Page, robot: Robot, act: Callable[[], object]) -> float:
    """Seconds from the event that `act` brings about until the velocity command is zero."""
    act()
    while robot.vx != 0:
        time.sleep(0.005)
    return time.time() - page.evaluate("window.happened") / 1e3


def best_of_three(measure: Callable[[], float]) -> float:
    """Machines that run tests are busy: the promise is the program's, not the machine's."""
    return min(measure() for _ in range(3))


class Another:
    """Another operator, who drives: engaged, standing."""

    def __init__(self, robot: Robot, name: str) -> None:
        self._socket = connect(robot.url.replace("http", "ws") + "/api/operator", compression=None)
        self._message = json.dumps({"seq": 0, "engage": True, "name": name})
        self._thread, self._leaves = threading.Thread(target=self._drive), threading.Event()

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._leaves.set()
        self._thread.join()
        self._socket.close()

    def _drive(self) -> None:
        while not self._leaves.wait(0.05):
            self._socket.send(self._message)
