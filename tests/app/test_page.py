"""The real page in Chromium, in front of the real server: what a person does with it, seen from the robot's side."""

from __future__ import annotations

import time
from typing import Any

import mujoco
import numpy as np
import pytest
from browser import (
    CALM,
    PICTURES_ON_DEMAND,
    SOON,
    VIEW,
    Another,
    Robot,
    best_of_three,
    click,
    engage,
    stopped_within,
    wait_until_connected,
    walk,
)
from playwright.sync_api import Page
from stand_ins import eventually

from policies.envelope import POSTURE, TWIST
from robots import catalog


@pytest.mark.row(3)
def test_engage_and_w_make_it_walk_and_letting_go_makes_it_stand(pages, robot, measured):
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

    took = best_of_three(stopped)
    assert took < SOON
    measured(3, f"W released in the browser: no velocity after {1e3 * took:.0f} ms")
    eventually(lambda: abs(robot.health["base"]["vx"]) < 0.15)
    assert robot.health["upright"]


def test_sliders_and_bars_go_as_far_as_the_legs_were_trained(pages):
    page = pages()
    ahead, side, turn = TWIST[1].tolist()
    ranges = dict(zip(("height", "roll", "pitch"), POSTURE.T.tolist(), strict=True)) | {
        "pace": [0.1, ahead],
        "side": [0.05, side],
        "turn": [0.1, turn],
    }
    for field, ends in ranges.items():
        slider = page.locator(f"[data-field={field}]")
        assert slider.evaluate("field => [Number(field.min), Number(field.max)]") == ends
        assert ends[0] <= float(slider.input_value()) <= ends[1]
    assert [float(bar.get_attribute("data-full") or 0) for bar in page.locator(".bar").all()] == [ahead, side, turn]


@pytest.mark.row(3)
@pytest.mark.parametrize("event", ["blur", "pagehide"])
def test_losing_the_page_lets_go_at_once(pages, robot, event, measured):
    page = pages()

    def lost() -> float:
        walk(page, robot)
        return stopped_within(page, robot, lambda: page.evaluate(f"dispatchEvent(new Event('{event}'))"))

    took = best_of_three(lost)
    assert took < SOON
    measured(3, f"{event}: HOLD, and no velocity after {1e3 * took:.0f} ms")
    assert robot.health["state"] == "HOLD"


@pytest.mark.row(3)
def test_hiding_the_page_lets_go(pages, robot):
    page = pages()
    walk(page, robot)
    page.evaluate("Object.defineProperty(document, 'hidden', { value: true }); document.dispatchEvent(new Event('visibilitychange'))")
    eventually(lambda: robot.health["state"] == "HOLD" and robot.vx == 0, 2)


@pytest.mark.row(1)
def test_closing_the_tab_while_w_is_held_stops_the_robot(pages, robot, measured):
    def closed() -> float:
        page = pages()
        walk(page, robot)
        before = time.time()
        page.close()
        while robot.vx != 0:
            time.sleep(0.005)
        return time.time() - before

    took = best_of_three(closed)
    assert took < SOON
    measured(1, f"browser tab closed while walking: no velocity after {1e3 * took:.0f} ms")
    eventually(lambda: robot.health["state"] == "HOLD")
    time.sleep(1.0)
    assert robot.health["upright"]


@pytest.mark.row(3)
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


def test_engage_and_stop_answer_to_enter(pages, robot):
    page = pages()

    def follows() -> bool:
        if not page.locator("#engage.on").count():
            page.locator("#engage").focus()
            page.keyboard.press("Enter")
        return robot.health["state"] == "ENGAGED"

    eventually(follows, 30)
    page.locator("#stop").focus()
    page.keyboard.press("Enter")
    eventually(lambda: robot.health["state"] == "STOPPED", 2)


def test_a_request_that_fails_is_told_and_a_page_waits_for_what_it_needs(pages, robot):
    page = pages()
    page.route("**/api/stop", lambda route: route.abort())
    page.keyboard.press("Escape")
    eventually(lambda: "Stop did not reach the robot" in (page.locator("#hint").text_content() or ""))
    page.route("**/api/scene", lambda route: route.abort())
    page.reload()
    eventually(lambda: page.locator("#lost:not([hidden])").count(), 60)
    page.unroute("**/api/scene")
    eventually(lambda: page.locator("#lost[hidden]").count() and page.locator("#state").inner_text() == "Stopped", 60)


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


def test_space_presses_what_tab_reached_and_engages_after_a_click(pages, robot):
    page = pages()
    page.locator("#panel").evaluate("panel => (panel.hidden = false)")
    page.locator("#label").focus()
    page.keyboard.press("Tab")
    page.keyboard.press("Space")
    assert page.locator("#fresh").is_checked()
    assert page.locator("#engage.on").count() == 0
    page.locator("#fresh").dispatch_event("pointerdown")  # a pointer's click leaves the focus there
    engage(page, robot)
    assert page.locator("#fresh").is_checked()


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


def test_dragging_a_handle_moves_the_wrist(pages, robot):
    page = pages(PICTURES_ON_DEMAND)
    at = robot.health["wrists"]["left"]["actual"]
    tip, metre, axis = _put_camera_beside(page, robot, at)

    def dragged() -> bool:
        page.mouse.move(*np.add(tip, [0, 20]))
        page.evaluate("draw()")
        page.mouse.move(*tip)
        page.evaluate(CALM)  # from here on nothing is drawn: a page that stalls for 200 ms is let go of, rightly
        engage(page, robot)
        page.mouse.down()
        for step in np.linspace(0.01, 0.1, 10):
            page.mouse.move(*(tip + step * metre))
            time.sleep(0.06)  # viser tells of a drag 20 times a second
        eventually(lambda: far(robot.health["wrists"]["left"]["target"]) or robot.health["state"] != "ENGAGED", 2)
        page.mouse.up()
        return far(robot.health["wrists"]["left"]["target"])

    def far(pose: dict[str, Any]) -> bool:
        return np.subtract(pose["position"], at["position"]) @ axis > 0.05

    eventually(dragged, 60)
    wanted = robot.health["wrists"]["left"]["target"]["position"]
    moved = np.subtract(wanted, at["position"])
    assert np.linalg.norm(moved - (moved @ axis) * axis) < 0.02, "along the arrow"

    def arrived() -> bool:
        return np.linalg.norm(np.subtract(robot.health["wrists"]["left"]["actual"]["position"], wanted)) < 0.03

    eventually(arrived, 10)
    right = robot.health["wrists"]["right"]["target"]["position"]
    assert np.linalg.norm(np.subtract(right, at["position"] * np.array([1, -1, 1]))) < 0.05


def _put_camera_beside(page: Page, robot: Robot, wrist: dict[str, Any]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Look at the left wrist from its left.

    Returns on the screen the tip of its forward arrow [2], beyond the arcs that turn it, and a metre along it [2]; then the arrow in the
    pelvis frame [3].
    """
    base, away, fov = robot.health["base"], 0.9, 0.7
    spot = np.add(wrist["position"], [0, 0, base["z"]])  # the robot stands at the origin and looks along x
    camera = np.add(spot, [0, away, 0]).tolist()
    page.locator(".deck").evaluate("deck => (deck.hidden = true)")  # in so small a view the pedals lie over the robot
    page.evaluate("""() => teleopTap.addEventListener("sent", ({ detail }) => {
        if (detail.type === "ViewerCameraMessage") window.camera = detail.position;
    })""")

    def beside() -> bool:
        page.evaluate("draw()")
        page.evaluate("view => teleopTap.deliver(view)", [
            {"type": "SetCameraPositionMessage", "position": camera, "initial": False},
            {"type": "SetCameraLookAtMessage", "look_at": spot.tolist(), "initial": False},
            {"type": "SetCameraFovMessage", "fov": fov, "initial": False},
        ])  # fmt: skip
        page.evaluate("draw()")
        return np.linalg.norm(np.subtract(page.evaluate("window.camera ?? [0, 0, 0]"), camera)) < 0.01

    eventually(beside, 60)
    axis, pixels_a_metre = np.empty(3), VIEW["height"] / 2 / np.tan(fov / 2) / away
    mujoco.mju_rotVecQuat(axis, np.array([1.0, 0.0, 0.0]), np.array(wrist["quaternion"]))
    metre = -pixels_a_metre * axis[[0, 2]]  # x is to the left from there, z up
    return np.array([VIEW["width"], VIEW["height"]]) / 2 + 0.145 * metre, metre, axis


def test_two_pages_drive_a_role_each_and_a_third_watches(pages, robot):
    legs, arms, watcher = pages(path="/?role=legs"), pages(path="/?role=arms"), pages()

    def both_follow() -> bool:
        for page, role in ((legs, "legs"), (arms, "arms")):
            if robot.health["roles"][role]["state"] != "ENGAGED":
                engage(page, robot, role)
        return robot.health["state"] == "ENGAGED"

    eventually(both_follow, 60)
    roles = robot.health["roles"]
    assert roles["arms"]["driver"] != roles["legs"]["driver"]
    watcher.keyboard.press("Space")
    watcher.keyboard.down("s")
    arms.keyboard.down("s")  # the arms' pedals walk nobody
    time.sleep(0.3)
    assert robot.health["roles"]["legs"]["driver"] == roles["legs"]["driver"]
    assert robot.vx >= 0
    click(watcher, "#take")
    eventually(lambda: robot.health["roles"]["arms"]["state"] == robot.health["roles"]["legs"]["state"] == "HOLD", 2)
    assert robot.health["driver"] not in (None, roles["arms"]["driver"], roles["legs"]["driver"])


def test_a_phone_asks_for_the_legs_and_is_handed_them(pages, robot):
    laptop, phone = pages(), pages(path="/?role=legs", has_touch=True)
    engage(laptop, robot)
    phone.evaluate("localStorage.setItem('teleop name', 'Bo')")
    phone.reload()
    wait_until_connected(phone)
    eventually(lambda: phone.locator("#take:not([hidden])").count())
    click(phone, "#crew-button")
    click(phone, "[data-role=legs] [data-do=ask]")
    eventually(lambda: "Bo asks for the legs" in (laptop.locator("#request:not([hidden])").all_text_contents() or [""])[0])
    click(laptop, "#request button")
    eventually(lambda: robot.health["roles"]["legs"]["driver"] == "Bo")
    assert robot.health["roles"]["arms"]["driver"] != "Bo"
    engage(phone, robot, "legs")
    click(phone, "[data-role=legs] [data-do=release]")
    eventually(lambda: robot.health["roles"]["legs"]["driver"] is None)


def test_a_link_for_a_phone_is_drawn(pages, robot):
    page = pages()
    click(page, "#crew-button")
    click(page, "[data-invite=legs]")
    eventually(lambda: page.locator("#invite img").count())
    assert page.locator("#invite a").get_attribute("href") == f"{robot.url}/?role=legs"


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
    eventually(lambda: robot.health["recording"] and page.locator("#endings:not([hidden])").count())
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
    walk(page, robot)
    click(page, "#episodes [title='Play back']")
    eventually(lambda: robot.health["state"] == "HOLD" and robot.vx == 0)
    eventually(lambda: page.locator("#playback:not([hidden])").count())
    click(page, "#episodes [title=Delete]")
    click(page, "#episodes [data-sure]")
    eventually(lambda: robot.ask("/api/episodes") == [])
    eventually(lambda: page.locator("#no-episodes:not([hidden])").count())


SWING = """async ([arm, tremble, width]) => {
  const { Reach } = await import("/web/reach.js"), reach = new Reach();
  for (let i = 0; i < 240; i++) {
    const up = width * Math.sin(i / 47), side = width * Math.sin(i / 30), noise = () => tremble * Math.sin(i * i);
    const [x, y, z] = [arm * Math.cos(side) * Math.cos(up), arm * Math.sin(up), arm * Math.sin(side) * Math.cos(up)];
    reach.add([0.2 + x + noise(), 1.3 + y - noise(), -0.1 + z + noise()]);
  }
  return reach.measure();
}"""
"""A straight arm [m] that swings about, over plus and minus `width` [rad]."""


def test_a_swinging_arm_tells_its_length_and_one_that_hardly_swings_what_to_do(pages, robot):
    page = pages()
    for arm in (0.45, 0.65):
        assert page.evaluate(SWING, [arm, 0.004, 0.8])["arm"] == pytest.approx(arm, abs=0.01)
    assert "wider" in page.evaluate(SWING, [0.55, 0.004, 0.1])["why"]
    assert "straight" in page.evaluate(SWING, [0.55, 0.06, 0.8])["why"]
