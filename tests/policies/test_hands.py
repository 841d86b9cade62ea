"""Human fingers to robot fingers: a made-up human hand that bends and pinches, on both hands of the H1."""

from __future__ import annotations

import time

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from policies.command import Command
from policies.hand_model import drive_range
from policies.hands import HandRetargeter
from robots import catalog
from robots.plant import Plant
from robots.target import Target

ROBOT = catalog.load("h1")
SPEC = ROBOT.spec
BONES = {"index": (0.045, 0.026, 0.023), "middle": (0.048, 0.03, 0.024), "ring": (0.044, 0.028, 0.024), "pinky": (0.035, 0.021, 0.02)}
KNUCKLES = {"index": (0.0, 0.026, 0.088), "middle": (0.0, 0.004, 0.09), "ring": (0.0, -0.016, 0.085), "pinky": (0.0, -0.034, 0.076)}
"""Of a right hand [m]: x into the palm's side, y to the thumb, z along the fingers."""
THUMB_ROOT = np.array([0.018, 0.03, 0.025])


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return ROBOT.model("play")


def human(side: int, bend: float = 0.0, thumb_tip: np.ndarray | None = None, size: float = 1.0, **bends: float) -> np.ndarray:
    """A hand [21, 3], turned and moved somewhere; every finger's joints bent by `bend` or its own angle [rad]."""
    points = [np.zeros(3)]
    fingers = []
    for name, knuckle in KNUCKLES.items():
        at, angle, chain = np.array(knuckle), 0.0, [np.array(knuckle)]
        for bone in BONES[name]:
            angle += bends.get(name, bend)
            at = at + bone * np.array([np.sin(angle), 0, np.cos(angle)])
            chain.append(at)
        fingers += chain
    tip = THUMB_ROOT + np.array([0.03, 0.05, 0.07]) if thumb_tip is None else thumb_tip
    points += [THUMB_ROOT + share * (tip - THUMB_ROOT) for share in (0.0, 0.4, 0.72, 1.0)]
    hand = size * np.array(points + fingers)
    return hand * [1, -1 if side == 0 else 1, 1] @ Rotation.from_euler("xyz", [0.4, -1.0, 2.0]).as_matrix() + [0.3, 1.2, -0.5]


def pinch(side: int, finger: int, gap: float, size: float = 1.0) -> np.ndarray:
    """Thumb and one finger (1: index) with their tips `gap` apart [m]."""
    name = list(BONES)[finger - 1]
    bent = {name: 0.75}
    tip = human(1, **bent)[4 * finger + 4]
    at = Rotation.from_euler("xyz", [0.4, -1.0, 2.0]).as_matrix() @ (tip - [0.3, 1.2, -0.5])  # back into the palm's frame
    way = THUMB_ROOT - at
    return human(side, 0.15, at + gap * way / np.linalg.norm(way), size, **bent)


def gap(retargeter: HandRetargeter, finger: int) -> float:
    tips = retargeter.tips()
    return float(np.linalg.norm(tips[finger] - tips[0]))


@pytest.mark.parametrize("side", [0, 1])
def test_an_open_hand_opens_and_a_fist_closes(model, side):
    retargeter = HandRetargeter(SPEC, model, side)
    assert (retargeter.solve(human(side))[2:] < 0.1).all()
    fist = [retargeter.solve(human(side, 1.3)) for _ in range(30)][-1]
    assert (fist[2:] > 0.75).all()


@pytest.mark.parametrize("side", [0, 1])
def test_a_finger_bends_alone(model, side):
    retargeter = HandRetargeter(SPEC, model, side)
    drives = [retargeter.solve(human(side, ring=1.0)) for _ in range(30)][-1]
    assert drives[4] > 0.5
    assert (drives[[2, 3, 5]] < 0.1).all()


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("size", [0.85, 1.15])
@pytest.mark.parametrize("finger", [1, 2])
def test_a_pinch_keeps_its_gap_scaled_to_the_robot(model, side, size, finger):
    retargeter = HandRetargeter(SPEC, model, side)
    reachable = retargeter.touches[finger - 1][1]
    for width in np.linspace(0.06, 0.002, 60):
        joints = pinch(side, finger, width, size)
        retargeter.solve(joints)
        wanted = retargeter.scale(joints) * width * size
        if wanted < 0.035:
            assert abs(gap(retargeter, finger) - max(wanted, reachable)) < 0.01
    assert gap(retargeter, finger) < reachable + 0.005


@pytest.mark.parametrize("side", [0, 1])
def test_drives_stay_between_open_and_closed_whatever_it_is_shown(model, side):
    retargeter = HandRetargeter(SPEC, model, side)
    rng = np.random.default_rng(1)
    for _ in range(100):
        drives = retargeter.solve(human(side, rng.uniform(-0.8, 2.0)) + rng.normal(scale=0.03, size=(21, 3)))
        assert ((drives >= 0) & (drives <= 1)).all()
    Command(hands=np.tile(drives, (2, 1))).vector()


@pytest.mark.parametrize("broken", [np.full((21, 3), np.nan), np.zeros((21, 3)), np.zeros((5, 3)), np.full((21, 3), 1e30) * np.eye(21, 3)])
def test_what_is_no_hand_changes_nothing(model, broken):
    retargeter = HandRetargeter(SPEC, model, 1)
    before = [retargeter.solve(human(1, 0.6)) for _ in range(5)][-1]
    np.testing.assert_array_equal(retargeter.solve(broken), before)


def test_the_answer_does_not_depend_on_where_the_hand_is_held(model):
    here, there = (HandRetargeter(SPEC, model, 1) for _ in range(2))
    joints = human(1, 0.5)
    moved = joints @ Rotation.from_euler("zyx", [1.0, 2.0, 0.5]).as_matrix() + [0.1, 0.2, 0.3]
    np.testing.assert_allclose(here.solve(joints), there.solve(moved), atol=1e-6)


def test_trembling_is_smoothed_and_a_quick_grasp_is_not_late(model):
    retargeter, rough = HandRetargeter(SPEC, model, 1), HandRetargeter(SPEC, model, 1)
    rng = np.random.default_rng(0)
    shown = [human(1, 0.5) + rng.normal(scale=0.002, size=(21, 3)) for _ in range(120)]
    smooth = np.std([retargeter.solve(joints) for joints in shown][20:], axis=0)
    bare = np.std([rough.solve(joints, dt=10.0) for joints in shown][20:], axis=0)
    assert (smooth[2:] < 0.8 * bare[2:]).all()
    closing = [retargeter.solve(human(1, 1.3)) for _ in range(6)][-1]  # 0.1 s
    assert (closing[2:] > 0.75).all()


def test_it_takes_less_than_two_milliseconds(model):
    retargeter, took = HandRetargeter(SPEC, model, 1), []
    for width in np.tile(np.linspace(0.1, 0.005, 100), 2):
        joints = pinch(1, 1, width)
        began = time.thread_time()
        retargeter.solve(joints)
        took.append(time.thread_time() - began)
    assert np.median(took) < 0.002


def test_in_the_play_model_a_pinch_touches_and_a_thumb_stops_at_the_fingers():
    plant = Plant(ROBOT)
    opened, closed = drive_range(SPEC)
    hands = SPEC.group("hands")

    def squeeze(drives: np.ndarray) -> set[frozenset[str]]:
        q, pelvis = SPEC.home.copy(), plant.data.qpos[:7].copy()
        q[hands] = drives
        for _ in range(60):
            plant.step(Target(q))
            plant.data.qpos[:7], plant.data.qvel[:6] = pelvis, 0
        assert min((contact.dist for contact in plant.data.contact), default=0.0) > -0.003
        return {frozenset(plant.model.geom(geom).name for geom in (c.geom1, c.geom2)) for c in plant.data.contact}

    assert squeeze(opened) == {touching for touching in squeeze(opened) if any("sole" in name for name in touching)}
    assert SPEC.hands
    pinch = np.concatenate([hand.pinch for hand in SPEC.hands])
    contacts = squeeze(opened + pinch * (closed - opened))
    for side in "LR":
        assert frozenset({f"{side}_thumb_distal", f"{side}_index_intermediate"}) in contacts
        tips = [plant.data.site(f"{side}_{finger}_tip").xpos for finger in ("thumb", "index")]
        assert np.linalg.norm(tips[0] - tips[1]) < 0.01
    squeeze(closed)
    pitch = plant.state().q[hands][[1, 7]]
    assert (pitch < closed[[1, 7]] - 0.03).all(), "the thumbs are stopped by the index fingers"


def test_a_closed_hand_does_not_drop_a_stick():
    spec = ROBOT.build("play")
    spec.option.gravity = (0, 0, 0)
    stick = spec.worldbody.add_body(name="stick", pos=(0, 0, 3))
    stick.add_freejoint(name="stick_free")
    stick.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=(0.018, 0.1, 0), mass=0.05, contype=2, conaffinity=2, condim=4, friction=(1, 0.01, 1e-4)
    )
    for key in list(spec.keys):
        spec.delete(key)
    model = spec.compile()
    data = mujoco.MjData(model)
    opened, closed = drive_range(SPEC)
    hands = SPEC.group("hands")
    data.qpos[2] = 1.0
    data.ctrl[:] = SPEC.home
    data.ctrl[hands] = opened

    def run(seconds: float) -> None:
        pelvis = data.qpos[:7].copy()
        for _ in range(round(seconds / model.opt.timestep)):
            mujoco.mj_step(model, data)
            data.qpos[:7], data.qvel[:6] = pelvis, 0

    run(1.0)
    palm = data.body("L_hand_base_link")
    turn = palm.xmat.reshape(3, 3)
    at = model.joint("stick_free").qposadr[0]
    data.qpos[at : at + 3] = palm.xpos + turn @ [-0.03, -0.13, 0.0]  # before the palm, across the fingers
    mujoco.mju_mat2Quat(data.qpos[at + 3 : at + 7], turn.ravel())
    data.qvel[model.joint("stick_free").dofadr[0] :][:6] = 0
    data.ctrl[hands][:6] = closed[:6]
    run(1.0)
    model.opt.gravity[2] = -9.81
    run(2.0)
    assert np.linalg.norm(data.body("stick").xpos - palm.xpos) < 0.15, "it did not fall: in two seconds that would be 20 m"
