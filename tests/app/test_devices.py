"""Gamepads, foot pedals and fingers on the real page: each walks the robot, and letting go in any way stops it."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from browser import NO_PICTURES, Robot, best_of_three, click, engage, wait_until_connected
from playwright.sync_api import Page
from stand_ins import eventually

from policies.command import COMMAND_LAYOUT
from policies.episode import MODES
from policies.recording.reader import Recording

PADS = f"""{NO_PICTURES};
window.plugged = [];
navigator.getGamepads = () => window.plugged;
window.pad = (axes, pressed = [], mapping = "standard") => (window.plugged = [{{
  id: "Pad (test)", index: 0, connected: true, mapping, axes,
  buttons: [...Array(16).keys()].map((i) => ({{ pressed: pressed.includes(i), value: Number(pressed.includes(i)) }})),
}}]);
pad([0, 0, 0, 0])"""
HIDE = """Object.defineProperty(document, "hidden", { value: true, configurable: true });
document.dispatchEvent(new Event("visibilitychange"))"""
PROMISE = 0.06
"""From letting go to the tick that knows of it [s]."""
VX = COMMAND_LAYOUT["twist"][0]


def pad(page: Page, *axes: float, pressed: tuple[int, ...] = (), mapping: str = "standard") -> None:
    page.evaluate("([axes, pressed, mapping]) => pad(axes, pressed, mapping)", [list(axes), list(pressed), mapping])


def walking(page: Page, robot: Robot, start: Callable[[], object], stop: Callable[[], object], vx: float = 0.49) -> None:
    """Engage, then start, until the robot is told to walk."""

    def walks() -> bool:
        stop()
        engage(page, robot)
        start()
        until = time.monotonic() + 1.0
        while time.monotonic() < until:
            if robot.vx > vx:
                return True
            time.sleep(0.02)
        return False

    eventually(walks, 60)


def heard_after(page: Page, robot: Robot, act: str, heard: Callable[[np.ndarray], np.ndarray]) -> float:
    """Seconds from `act` (a script in the page) until the first tick of which `heard(rows)` is true."""
    robot.ask("/api/episodes", "POST")
    eventually(lambda: robot.health["recording"])
    recording = robot.health["recording"]
    time.sleep(0.1)
    then = page.evaluate(f"{act}; Date.now()") / 1e3
    time.sleep(0.3)
    robot.ask(f"/api/episodes/{recording}/stop", "POST")
    rows = _rows(robot.recordings, recording)
    after = rows[(rows["wall"] > then) & heard(rows)]
    robot.ask(f"/api/episodes/{recording}", "DELETE")
    assert len(after), "it was never heard"
    return float(after["wall"][0]) - then


def _rows(folder: Path, id: str) -> np.ndarray:
    for file in folder.glob("*.mcap"):
        with Recording(file) as recording:
            for episode in recording.episodes():
                if episode.info.id == id:
                    return episode.rows
    raise AssertionError("it was not recorded")


def let_go(rows: np.ndarray) -> np.ndarray:
    return rows["raw"][:, VX] == 0


def held(rows: np.ndarray) -> np.ndarray:
    return rows["mode"] == MODES.index("HOLD")


@pytest.mark.parametrize(
    ("act", "heard"),
    [
        ("pad([0, 0, 0, 0])", let_go),
        ("window.plugged = []", held),
        (HIDE, held),
        ("dispatchEvent(new Event('blur'))", held),
    ],
    ids=["released", "unplugged", "hidden", "out of focus"],
)
def test_a_stick_walks_and_letting_go_stops_within_60_ms(pages, robot, act, heard):
    page = pages(PADS)

    def stopped() -> float:
        page.evaluate("delete document.hidden")
        walking(page, robot, lambda: pad(page, 0, -1, 0, 0), lambda: pad(page, 0, 0, 0, 0))
        return heard_after(page, robot, act, heard)

    assert best_of_three(stopped) < PROMISE
    eventually(lambda: robot.vx == 0, 2)


def test_half_a_stick_walks_less_than_half_as_fast_and_a_tremble_not_at_all(pages, robot):
    page = pages(PADS)
    walking(page, robot, lambda: pad(page, 0, -0.5, 0, 0), lambda: pad(page, 0, 0, 0, 0), vx=0.05)
    eventually(lambda: 0.05 < robot.vx < 0.2)
    pad(page, 0.1, -0.1, 0.1, 0.1)
    eventually(lambda: robot.vx == 0, 2)


def test_the_pads_own_button_engages_and_another_stops(pages, robot):
    page = pages(PADS)

    def follows() -> bool:
        pad(page, 0, 0, 0, 0, pressed=(0,))
        time.sleep(0.1)
        pad(page, 0, 0, 0, 0)
        time.sleep(0.3)
        return robot.health["state"] == "ENGAGED"

    eventually(follows, 30)
    pad(page, 0, 0, 0, 0, pressed=(1,))
    eventually(lambda: robot.health["state"] == "STOPPED", 2)


def test_a_stick_that_was_pushed_before_engage_walks_nobody(pages, robot):
    page = pages(PADS)
    pad(page, 0, -1, 0, 0)
    time.sleep(0.2)
    engage(page, robot)
    pad(page, 0, -0.9, 0, 0)
    time.sleep(0.3)
    assert robot.vx == 0


def test_a_foot_pedal_that_is_a_pad_learns_what_it_does_and_keeps_it(pages, robot):
    page = pages(PADS)
    pad(page, 1, 0, mapping="")  # a pedal that rests at one end of its axis
    eventually(lambda: page.evaluate("document.querySelector('#teleop') !== null"))
    time.sleep(0.5)
    click(page, "#help-button")
    click(page, "[data-learn=forward]")
    pad(page, -0.9, 0, mapping="")
    eventually(lambda: "axis 0 from 1" in page.locator("[data-learn=forward]").inner_text())
    click(page, "#help-button")
    page.reload()
    wait_until_connected(page)
    page.evaluate("pad([1, 0], [], '')")
    time.sleep(0.5)
    walking(page, robot, lambda: pad(page, -1, 0, mapping=""), lambda: pad(page, 1, 0, mapping=""))
    pad(page, 1, 0, mapping="")
    eventually(lambda: robot.vx == 0, 2)


def test_a_foot_pedal_that_is_a_keyboard_learns_what_it_does(pages, robot):
    page = pages()
    click(page, "#help-button")
    click(page, "[data-learn=forward]")
    page.keyboard.press("b")
    eventually(lambda: "B" in page.locator("[data-learn=forward]").inner_text())
    click(page, "#help-button")
    walking(page, robot, lambda: page.keyboard.down("b"), lambda: page.keyboard.up("b"))
    key_up = "dispatchEvent(new KeyboardEvent('keyup', { code: 'KeyB' }))"

    def stopped() -> float:
        walking(page, robot, lambda: page.keyboard.down("b"), lambda: page.keyboard.up("b"))
        return heard_after(page, robot, key_up, let_go)

    assert best_of_three(stopped) < PROMISE


def test_a_finger_on_a_pedal_walks_and_lifting_it_stops_within_60_ms(pages, robot):
    page = pages(has_touch=True)
    pedal = "document.querySelector('#teleop').shadowRoot.querySelector('[data-direction=forward]')"
    touch = "{ pointerId: 7, pointerType: 'touch', isPrimary: true, button: 0, bubbles: true, composed: true }"
    page.evaluate("Element.prototype.setPointerCapture = () => {}")  # there is no real finger to capture
    down, up = (f"{pedal}.dispatchEvent(new PointerEvent('{name}', {touch}))" for name in ("pointerdown", "pointerup"))

    def stopped() -> float:
        walking(page, robot, lambda: page.evaluate(down), lambda: page.evaluate(up))
        return heard_after(page, robot, up, let_go)

    assert best_of_three(stopped) < PROMISE


def test_the_speed_limits_are_the_operators(pages, robot):
    page = pages(PADS)
    slow = "input => { input.value = 0.2; input.dispatchEvent(new Event('input')) }"
    page.locator("[data-field=pace]").evaluate(slow)
    walking(page, robot, lambda: pad(page, 0, -1, 0, 0), lambda: pad(page, 0, 0, 0, 0), vx=0.19)
    time.sleep(0.3)
    assert robot.vx == pytest.approx(0.2)
