"""Makes the stand-ins of this folder importable, in spawned processes too; one simulation process for the tests of a file."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from browser import CHROMIUM, FLAGS, NO_PICTURES, STOPWATCH, VIEW, Robot, wait_until_connected
from stand_ins import Hanging, eventually

from app.simulation import Simulation

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page


@pytest.fixture(scope="module")
def shared_simulation() -> Iterator[Simulation]:
    """A hanging robot in a process of its own, for the tests of one file: each file's operators count their presses from 1."""
    running = Simulation(Hanging())
    running.start()
    running.wait()
    yield running
    running.close()


@pytest.fixture
def simulation(shared_simulation: Simulation) -> Simulation:
    """The same, alive."""
    if shared_simulation.lost:
        shared_simulation.restart()
    return shared_simulation


@pytest.fixture(scope="module")
def teleop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    """The whole program, with its real robot."""
    robot = Robot(tmp_path_factory.mktemp("recordings"))
    yield robot
    robot.close()


@pytest.fixture
def robot(teleop: Robot) -> Robot:
    """The same, at home and driven by nobody."""
    eventually(lambda: teleop.health["driver"] is None)
    teleop.ask("/api/reset", "POST")
    eventually(lambda: teleop.health["state"] == "STOPPED")
    return teleop


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip("no chromium: apt-get install chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture
def pages(chromium: Browser, robot: Robot) -> Iterator[Callable[..., Page]]:
    """Opens pages, each in a browser profile of its own; a script error in one fails the test."""
    contexts, errors = [], []

    def opened(script: str = NO_PICTURES, path: str = "/", **options: Any) -> Page:
        context = chromium.new_context(**{"viewport": VIEW} | options)
        contexts.append(context)
        page = context.new_page()
        page.add_init_script(f"{script}; {STOPWATCH}")
        page.on("pageerror", lambda error: errors.append(error))
        page.goto(robot.url + path)
        wait_until_connected(page)
        return page

    yield opened
    for context in contexts:
        context.close()
    assert errors == []
