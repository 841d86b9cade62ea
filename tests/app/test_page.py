"""The real page in Chromium, in front of the real server: what a person does with it, seen from the robot's side.

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
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from playwright.sync_api import Browser, Page, sync_playwright
from stand_ins import eventually
from websockets.sync.client import connect

from robots import catalog

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = [
    "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run",
    "--enable-unsafe-swiftshader",
]  # fmt: skip
VIEW = {"width": 300, "height": 220}
NO_PICTURES = "window.requestAnimationFrame = () => 0"
FEW_PICTURES = "window.requestAnimationFrame = (draw) => setTimeout(() => draw(performance.now()), 400)"
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

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium: apt-get install chromium")


class Robot:
    """A running `teleop`."""

    def __init__(self, recordings: Path) -> None:
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


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    robot = Robot(tmp_path_factory.mktemp("recordings"))
    yield robot
    robot.close()


@pytest.fixture
def robot(running: Robot) -> Robot:
    running.ask("/api/reset", "POST")
    eventually(lambda: running.health["state"] == "STOPPED" and running.health["driver"] is None)
    return running


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield chromium
        chromium.close()


@pytest.fixture
def pages(browser: Browser, robot: Robot) -> Iterator[Callable[..., Page]]:
    """Opens pages, each in a browser profile of its own; a script error in one fails the test."""
    contexts, errors = [], []

    def opened(pictures: str = NO_PICTURES, **options: Any) -> Page:
        context = browser.new_context(viewport=VIEW, **options)
        contexts.append(context)
        page = context.new_page()
        page.add_init_script(f"{pictures}; {STOPWATCH}")
        page.on("pageerror", lambda error: errors.append(error))
        page.goto(robot.url)
        page.wait_for_function(
            "['STOPPED', 'HOLD', 'ENGAGED'].includes(document.querySelector('#teleop')?.dataset.state)", timeout=START * 1e3, polling=50
        )
        return page

    yield opened
    for context in contexts:
        context.close()
    assert errors == []


def click(page: Page, selector: str) -> None:
    """Without waiting for drawn frames, as page.click would."""
    page.locator(selector).evaluate("element => element.click()")


def engage(page: Page, robot: Robot) -> None:
    """Tap Engage until the robot follows: a page that the machine kept from running for 200 ms is let go of, rightly."""

    def follows() -> bool:
        page.keyboard.press("Space")
        until = time.monotonic() + 1.0
        while time.monotonic() < until:
            if robot.health["state"] == "ENGAGED":
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


def test_engage_and_w_make_it_walk_and_letting_go_makes_it_stand(pages, robot):
    page = pages()
    page.keyboard.down("w")
    time.sleep(0.3)
    assert robot.vx == 0  # nobody pressed Engage
    page.keyboard.up("w")

    start = robot.health["base"]["x"]

    def went_ahead() -> bool:
        if robot.vx < 0.4:
            walk(page, robot)
        return robot.health["base"]["x"] > start + 0.3

    eventually(went_ahead, 90)

    def stopped() -> float:
        walk(page, robot)
        return stopped_within(page, robot, lambda: page.keyboard.up("w"))

    assert best_of_three(stopped) < SOON
    eventually(lambda: abs(robot.health["base"]["vx"]) < 0.15)
    assert robot.health["upright"]


@pytest.mark.parametrize("event", ["blur", "pagehide"])
def test_losing_the_page_lets_go_at_once(pages, robot, event):
    page = pages()

    def lost() -> float:
        walk(page, robot)
        return stopped_within(page, robot, lambda: page.evaluate(f"dispatchEvent(new Event('{event}'))"))

    assert best_of_three(lost) < SOON
    assert robot.health["state"] == "HOLD"


def test_hiding_the_page_lets_go(pages, robot):
    page = pages()
    walk(page, robot)
    page.evaluate("Object.defineProperty(document, 'hidden', { value: true }); document.dispatchEvent(new Event('visibilitychange'))")
    eventually(lambda: robot.health["state"] == "HOLD" and robot.vx == 0, 2)


def test_closing_the_tab_while_w_is_held_stops_the_robot(pages, robot):
    def closed() -> float:
        page = pages()
        walk(page, robot)
        before = time.time()
        page.close()
        while robot.vx != 0:
            time.sleep(0.005)
        return time.time() - before

    assert best_of_three(closed) < SOON
    eventually(lambda: robot.health["state"] == "HOLD")
    time.sleep(1.0)
    assert robot.health["upright"]


def test_a_pedal_walks_while_it_is_pressed(pages, robot):
    page = pages(has_touch=True)
    box = page.locator("[data-direction=forward]").bounding_box()
    assert box

    def walks() -> bool:
        engage(page, robot)
        page.mouse.up()
        page.mouse.move(box["x"] + 20, box["y"] + 20)
        page.mouse.down()
        until = time.monotonic() + 1.0
        while time.monotonic() < until:
            if robot.vx > 0.49:
                return True
            time.sleep(0.02)
        return False

    eventually(walks, 60)
    page.mouse.move(5, 5)  # captured: the finger may slide off
    time.sleep(0.2)
    assert robot.vx > 0
    page.mouse.up()
    eventually(lambda: robot.vx == 0, 2)


def test_stop_stops_and_only_a_fresh_press_goes_on(pages, robot):
    page = pages()
    walk(page, robot)
    page.keyboard.press("Escape")
    eventually(lambda: robot.health["state"] == "STOPPED" and robot.vx == 0, 2)
    time.sleep(0.5)  # W is still held
    assert robot.health["state"] == "STOPPED"
    engage(page, robot)


def test_keys_in_a_text_field_and_shortcuts_drive_nothing(pages, robot):
    page = pages()
    engage(page, robot)
    page.keyboard.down("Control")
    page.keyboard.down("w")
    time.sleep(0.3)
    assert robot.vx == 0
    page.keyboard.up("w")
    page.keyboard.up("Control")
    page.locator("#panel").evaluate("panel => (panel.hidden = false)")
    page.locator("#label").focus()
    page.keyboard.type("wwd")
    assert robot.vx == 0
    assert page.locator("#label").input_value() == "wwd"


def test_a_watcher_drives_nothing_until_it_takes_over(pages, robot):
    with Another(robot, "Ada"):
        page = pages()
        page.keyboard.press("Space")
        page.keyboard.down("w")
        until = time.monotonic() + 1.0
        while time.monotonic() < until:
            assert robot.vx == 0
        assert robot.health["driver"] == "Ada"
        page.keyboard.up("w")
        eventually(lambda: page.locator("#take:not([hidden])").count())
        click(page, "#take")
        eventually(lambda: robot.health["driver"] not in ("Ada", None))
        eventually(lambda: robot.health["state"] == "HOLD", 2)  # until somebody presses Engage again
        engage(page, robot)


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


def _put_camera_beside(page: Page, robot: Robot, wrist: dict[str, Any]) -> tuple[float, float]:
    """Look at the left wrist from its left. Returns where the middle of its forward arrow is on the screen."""
    base, away, fov = robot.health["base"], 0.9, 0.7
    spot = np.add(wrist["position"], [0, 0, base["z"]])  # the robot stands at the origin and looks along x
    page.evaluate("view => teleopTap.deliver(view)", [
        {"type": "SetCameraPositionMessage", "position": np.add(spot, [0, away, 0]).tolist(), "initial": False},
        {"type": "SetCameraLookAtMessage", "look_at": spot.tolist(), "initial": False},
        {"type": "SetCameraFovMessage", "fov": fov, "initial": False},
    ])  # fmt: skip
    pixels_a_metre = VIEW["height"] / 2 / np.tan(fov / 2) / away
    time.sleep(2)
    return VIEW["width"] / 2 - 0.07 * pixels_a_metre, VIEW["height"] / 2  # x is to the left from there


def test_the_page_places_every_body_where_mujoco_does(pages, robot):
    page = pages()
    model = catalog.load("h1").model("play")
    data, random = mujoco.MjData(model), np.random.default_rng(0)
    for _ in range(5):
        data.qpos[:] = random.uniform(-1, 1, model.nq)
        data.qpos[3:7] /= np.linalg.norm(data.qpos[3:7])
        mujoco.mj_kinematics(model, data)
        poses = page.evaluate(
            "async (qpos) => { const { forward } = await import('/web/kinematics.js');"
            " return forward((await (await fetch('/api/scene')).json()).bodies, qpos) }",
            data.qpos.tolist(),
        )
        np.testing.assert_allclose([pose["position"] for pose in poses], data.xpos[1:], atol=1e-9)
        turns = np.abs(np.einsum("ij,ij->i", [pose["quaternion"] for pose in poses], data.xquat[1:]))
        np.testing.assert_allclose(turns, 1, atol=1e-9)


def test_an_episode_is_recorded_listed_played_back_and_deleted(pages, robot):
    page = pages()
    click(page, "#record")
    eventually(lambda: robot.health["recording"])
    time.sleep(1.0)
    page.locator("#label").evaluate("field => (field.value = 'a wave')")
    click(page, "#record")
    eventually(lambda: robot.health["recording"] is None)
    eventually(lambda: page.locator("#episodes b").all_text_contents() == ["a wave"])
    click(page, "#episodes [title='Play back']")
    eventually(lambda: page.locator("#playback:not([hidden]) #playback-name").all_text_contents() == ["a wave"])
    eventually(lambda: float(page.locator("#playback-time").get_attribute("max") or 0) > 0.5)
    engage(page, robot)  # ends the playback: nobody drives blind
    eventually(lambda: page.locator("#playback[hidden]").count())
    click(page, "#episodes [title=Delete]")
    click(page, "#episodes [data-sure]")
    eventually(lambda: robot.ask("/api/episodes") == [])
    eventually(lambda: page.locator("#no-episodes:not([hidden])").count())
