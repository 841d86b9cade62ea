"""Other legs, picked in the real page while the robot walks: it stays up, and the recording says which ones walked."""

from __future__ import annotations

import re
import time

from browser import click, walk
from stand_ins import eventually

from policies.recording.library import Library
from policies.recording.reader import Recording

OURS = "window.requestAnimationFrame = (draw) => (/this\\.#draw/.test(draw) ? setTimeout(() => draw(performance.now()), 50) : 0)"
"""Our page moves its picture; viser, which takes all of a machine without a graphics processor, draws nothing of it."""
OVERHEAR = """() => {
  window.visible = {};
  const deliver = teleopTap.deliver.bind(teleopTap);
  teleopTap.deliver = (messages) => {
    for (const { type, name, visible } of messages) if (type === "SetSceneNodeVisibilityMessage") window.visible[name] = visible;
    deliver(messages);
  };
}"""
PICK = "(select, name) => { select.value = name; select.dispatchEvent(new Event('change')); }"


def test_the_legs_change_while_it_walks_and_with_them_what_is_expected(pages, robot):
    page = pages(OURS)
    page.evaluate(OVERHEAR)
    wrists = robot.ask("/api/scene")["wrists"]
    drawn = [name for wrist in wrists for name in (*wrist["ahead"], wrist["expected"])]

    def shown() -> set[bool | None]:
        return set(page.evaluate("names => names.map((name) => window.visible[name])", drawn))

    def pick(name: str) -> None:
        page.locator("#legs select").evaluate(PICK, name)
        eventually(lambda: robot.health["policy"] == name, 2)

    def goes_ahead() -> None:
        start = robot.health["base"]["x"]

        def gone() -> bool:
            if robot.vx < 0.4:
                walk(page, robot)
            return robot.health["base"]["x"] > start + 0.3

        eventually(gone, 60)
        assert robot.health["upright"]

    click(page, "#forecast")
    eventually(lambda: shown() == {True})
    walk(page, robot)
    click(page, "#record")
    eventually(lambda: robot.health["recording"])
    goes_ahead()
    pick("walk_h1_no_prior")
    eventually(lambda: shown() == {False})
    assert page.locator("#expected").text_content() == "walk_h1_no_prior has no motion prior."
    goes_ahead()
    pick("walk_h1")
    eventually(lambda: shown() == {True})
    goes_ahead()
    eventually(lambda: re.search("mm off|stay", page.locator("#expected").text_content() or ""))
    page.keyboard.up("w")
    click(page, "#record")
    eventually(lambda: robot.health["recording"] is None)
    time.sleep(0.5)
    assert robot.health["upright"]
    click(page, "#forecast")
    eventually(lambda: shown() == {False})

    (path,) = Library(robot.recordings).files()
    with Recording(path) as recording:
        (episode,) = recording.episodes()
    rows = episode.rows
    changes = [int(policy) for before, policy in zip(rows["policy"][:-1], rows["policy"][1:], strict=True) if policy != before]
    other = robot.health["policies"].index("walk_h1_no_prior")
    assert rows["policy"][0] == 0
    assert changes == [other, 0]
    assert not rows["latent"][rows["policy"] == other].any()
    assert rows["latent"][rows["policy"] == 0].any(axis=1).all()
