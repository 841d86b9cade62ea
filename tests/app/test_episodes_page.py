"""The work of recording demonstrations in the page: endings and their keys, seeded starts, playback with figures, the alarm."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest
from browser import Robot, click, engage
from stand_ins import eventually

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.usefixtures("chromium")


@pytest.fixture
def page(pages: Callable[..., Page], robot: Robot) -> Page:
    """A page of a robot without episodes."""
    for episode in robot.ask("/api/episodes"):
        robot.ask(f"/api/episodes/{episode['id']}", "DELETE")
    return pages()


def record(page: Page, robot: Robot, ending: str, task: str = "") -> None:
    """An episode of half a second; `ending` is a key, or several."""
    page.locator("#label").evaluate("(field, task) => (field.value = task)", task)
    page.keyboard.press("KeyR")
    eventually(lambda: robot.health["recording"])
    time.sleep(0.5)
    eventually(lambda: page.locator("#endings:not([hidden])").count())
    for key in ending.split():
        page.keyboard.press(key)
    eventually(lambda: robot.health["recording"] is None and page.locator("#endings[hidden]").count())  # the page knows it, too


def test_keys_end_an_episode_as_success_failure_or_not_at_all(page: Page, robot: Robot) -> None:
    record(page, robot, "KeyY", "pick up the cup")
    record(page, robot, "KeyN", "wave")
    record(page, robot, "Backspace Backspace", "nothing")
    told = [(episode["label"], episode["success"]) for episode in robot.ask("/api/episodes")]
    assert told == [("wave", False), ("pick up the cup", True)]
    eventually(lambda: "✓ 1 · ✗ 1" in (page.locator("#counters").text_content() or ""))
    page.locator("#episodes .mark").first.evaluate("button => button.click()")
    eventually(lambda: robot.ask("/api/episodes")[0]["success"] is None)
    assert page.locator("#label").input_value() == "nothing", "the task stays for the next try"


def test_between_episodes_the_robot_starts_elsewhere_and_the_recording_knows_where(page: Page, robot: Robot) -> None:
    click(page, "#fresh")
    engage(page, robot)
    record(page, robot, "KeyY")
    eventually(lambda: robot.health["state"] == "STOPPED" and abs(robot.health["base"]["yaw"]) > 0.01)
    start = robot.health["base"]
    record(page, robot, "KeyY")
    assert [episode["seed"] for episode in robot.ask("/api/episodes")] == [1, 0]
    robot.ask("/api/reset", "POST")
    eventually(lambda: abs(robot.health["base"]["x"]) < 0.01)
    robot.ask("/api/reset?seed=1", "POST")
    eventually(lambda: abs(robot.health["base"]["yaw"] - start["yaw"]) < 0.02)


def test_playback_shows_events_and_figures_of_two_episodes(page: Page, robot: Robot) -> None:
    record(page, robot, "KeyY", "one")
    record(page, robot, "KeyN", "two")
    eventually(lambda: page.locator("#episodes b").all_text_contents() == ["two", "one"])
    page.locator("#episodes [title='Play back']").first.evaluate("button => button.click()")
    eventually(lambda: page.locator("#figures tr").count() == 2)
    assert page.locator("#figures tr").nth(1).locator("td").all_text_contents()[:2] == ["two", "0"]
    marks = page.locator("#playback-events button")
    assert (marks.count(), marks.first.get_attribute("data-kind")) == (1, "stopped")
    page.locator("#against").evaluate("field => { field.selectedIndex = 1; field.dispatchEvent(new Event('change')) }")
    eventually(lambda: page.locator("#figures tr").count() == 3)
    click(page, "#swap")
    eventually(lambda: page.locator("#playback-name").text_content() == "one")
    page.locator("#playback-time").evaluate("field => { field.value = 0.2; field.dispatchEvent(new Event('input')) }")
    eventually(lambda: (page.locator("#playback-clock").text_content() or "").startswith("0:00 /"))
    page.route("**/frames", lambda route: route.abort())
    page.locator("#episodes [title='Play back']").first.evaluate("button => button.click()")
    eventually(lambda: page.locator("#hint.alert").text_content())
    click(page, "#swap")  # what cannot be had takes nothing away
    eventually(lambda: page.locator("#playback-name").text_content() == "two")
    click(page, "#playback-close")


def test_an_alarm_of_the_recording_is_seen(page: Page, robot: Robot) -> None:
    aside = robot.recordings.with_name("aside")
    if robot.recordings.exists():
        robot.recordings.rename(aside)
    robot.recordings.write_text("no folder")
    try:
        assert page.locator("#alarm").is_hidden()
        page.keyboard.press("KeyR")
        eventually(lambda: robot.health["recording_alarm"])
        eventually(lambda: page.locator("#alarm").is_visible())
        assert page.locator("#alarm span").text_content() == robot.health["recording_alarm"]
    finally:
        robot.recordings.unlink()
        if aside.exists():
            aside.rename(robot.recordings)
    page.keyboard.press("KeyR")
    eventually(lambda: page.locator("#alarm").is_hidden())
    eventually(lambda: robot.health["recording"])
    eventually(lambda: page.locator("#endings:not([hidden])").count())
    page.keyboard.press("Backspace")
    assert "press again to discard" in (page.locator("#hint").text_content() or "")
    assert robot.health["recording"]
    page.keyboard.press("Backspace")
    eventually(lambda: robot.health["recording"] is None)
