"""The arms go where the wrists are asked to be, and never anywhere they must not be."""

import daqp
import mujoco
import numpy as np
import pytest

from policies.bench.reach import _Bench
from policies.reach import Reach
from robots.catalog import load

ROBOT = load("h1")
SPEC = ROBOT.spec
GROUP = SPEC.group("waist", "arms")
HOME = SPEC.home[GROUP]
LEFT, RIGHT = slice(1, 8), slice(8, 15)


@pytest.fixture(scope="module")
def shared() -> Reach:
    """One Reach for all tests: building it takes longer than most of them."""
    return Reach(ROBOT)


@pytest.fixture
def reach(shared: Reach) -> Reach:
    shared.reset(HOME)
    return shared


@pytest.fixture(scope="module")
def bench() -> _Bench:
    return _Bench(ROBOT, seed=3)


def moved(wrists: np.ndarray, arm: int, *shift: float) -> np.ndarray:
    """The poses with one wrist shifted [m]."""
    out = wrists.copy()
    out[arm, :3] += shift
    return out


def turned(wrists: np.ndarray, arm: int, *rotation: float) -> np.ndarray:
    """The poses with one wrist turned about its own axes [rad]."""
    out, quaternion = wrists.copy(), wrists[arm, 3:].copy()
    mujoco.mju_quatIntegrate(quaternion, np.array(rotation), 1.0)
    out[arm, 3:] = quaternion
    return out


def settle(reach: Reach, wrists: np.ndarray, seconds: float = 2.0, waist: float = 0.0):
    for _ in range(round(50 * seconds) - 1):
        reach.solve(wrists, waist)
    return reach.solve(wrists, waist)


def test_wrist_poses_are_those_of_the_physics_model(reach: Reach) -> None:
    model = ROBOT.model("training")
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    data.qpos[:7] = 0, 0, 0, 1, 0, 0, 0
    q = np.random.default_rng(0).uniform(SPEC.lower[GROUP], SPEC.upper[GROUP])
    data.qpos[[model.joint(name).qposadr[0] for name in SPEC.motor_names[GROUP]]] = q
    mujoco.mj_kinematics(model, data)
    poses = reach.forward(q)
    for pose, site in zip(poses, SPEC.wrists, strict=True):
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, pose[3:])
        assert pose[:3] == pytest.approx(data.site(site).xpos, abs=1e-9)
        assert rotation == pytest.approx(data.site(site).xmat, abs=1e-9)


def test_at_home_nothing_moves_and_nothing_is_blamed(reach: Reach) -> None:
    home = reach.forward(HOME)
    reached = reach.solve(home)
    assert (reached.q == HOME).all()
    assert reached.reasons == ("", "")
    assert reached.reachable == pytest.approx(home, abs=1e-9)


def test_reachable_targets_near_home_are_reached_within_a_second(bench: _Bench) -> None:
    report = bench.accuracy(10, near=True)["after_1_s"]
    assert report["position_mm"]["mean"] < 3
    assert report["rotation_deg"]["mean"] < 1
    assert report["reached"] == 1.0


def test_reachable_targets_anywhere_are_reached_by_changing_posture_where_needed(bench: _Bench) -> None:
    assert bench.accuracy(15, near=False)["after_2_s"]["reached"] >= 0.9


def test_wild_targets_do_no_harm(bench: _Bench) -> None:
    report = bench.sweep(60, ticks=15)
    assert report["exceptions"] == 0
    assert report["deepest_overlap_mm"] < 5
    assert report["beyond_limits_rad"] <= 1e-9
    assert report["largest_share_of_motor_speed"] <= 0.6 + 1e-6
    assert {"invalid", "collision", "reach", "limit"} <= report["reasons"].keys()


def test_a_target_out_of_reach_is_followed_to_the_arms_length_and_then_the_arm_is_still(reach: Reach) -> None:
    far = moved(reach.forward(HOME), 0, 1.0, 0.2, 0.3)
    reached = settle(reach, far, seconds=3)
    assert reached.reasons == ("reach", "")
    assert (reach.solve(far).q == reached.q).all()
    shoulder = np.array([0.0055, 0.15535, 0.42999])
    towards = (far[0, :3] - shoulder) / np.linalg.norm(far[0, :3] - shoulder)
    assert (reached.reachable[0, :3] - shoulder) @ towards > 0.6, "stretched towards the target"


def test_a_target_inside_the_body_stops_at_the_body(reach: Reach) -> None:
    inside = reach.forward(HOME)
    inside[0, :3] = 0.0, 0.0, 0.2
    reached = settle(reach, inside, seconds=3)
    assert reached.reasons[0] == "collision"
    assert (reach.solve(inside).q == reached.q).all()
    assert reached.error[0, 0] > 0.1


def test_a_hand_bent_too_far_keeps_its_place_and_names_the_limit(reach: Reach) -> None:
    bent = turned(reach.forward(HOME), 1, 0.0, 1.2, 1.5)
    reached = settle(reach, bent, seconds=3)
    assert reached.reasons == ("", "limit")
    assert (reach.solve(bent).q == reached.q).all()
    assert reached.error[1, 0] < 0.05


@pytest.mark.parametrize("at", range(7))
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e30])
def test_an_arm_holds_when_its_target_is_no_pose_while_the_other_goes_on(reach: Reach, at: int, bad: float) -> None:
    home = reach.forward(HOME)
    wrists = moved(home, 1, 0.05, 0, 0)
    wrists[0, at] = bad
    reached = settle(reach, wrists, seconds=0.5)
    assert reached.reasons == ("invalid", "")
    assert (reached.q[LEFT] == HOME[LEFT]).all()
    assert reached.error[1, 0] < 0.002
    assert reached.error[0] == pytest.approx([0, 0], abs=1e-3), "it is still where it was last told to be"


@pytest.mark.parametrize("wrists", [np.zeros((2, 7)), np.full((2, 7), np.nan), np.zeros((3, 7)), np.zeros(0), 2 * np.ones((2, 7))])
def test_both_arms_hold_when_neither_target_is_a_pose(reach: Reach, wrists: np.ndarray) -> None:
    reached = reach.solve(wrists, waist=np.nan)
    assert reached.reasons == ("invalid", "invalid")
    assert (reached.q == HOME).all()


def fails(*_args: object) -> None:
    raise ValueError("no")


@pytest.mark.parametrize("solver", [fails, lambda h, f, *_: (f * np.nan, 0.0, 1, {"lam": f}), lambda h, f, *_: (f, 0.0, -1, {"lam": f})])
def test_the_arms_hold_when_the_solver_fails(reach: Reach, monkeypatch: pytest.MonkeyPatch, solver) -> None:
    wrists = moved(reach.forward(HOME), 0, 0.1, 0, 0)
    monkeypatch.setattr(daqp, "solve", solver)
    reached = reach.solve(wrists)
    assert reached.reasons == ("solver", "solver")
    assert (reached.q == HOME).all()
    monkeypatch.undo()
    assert settle(reach, wrists, seconds=1).error[0, 0] < 0.002


def test_mirrored_targets_give_mirrored_arms(reach: Reach) -> None:
    right = settle(reach, moved(turned(reach.forward(HOME), 1, 0.2, 0.1, 0.3), 1, 0.1, -0.1, 0.2)).q
    reach.reset(HOME)
    left = settle(reach, moved(turned(reach.forward(HOME), 0, -0.2, 0.1, -0.3), 0, 0.1, 0.1, 0.2)).q
    sign = SPEC.mirror[1][GROUP]
    assert left[LEFT] == pytest.approx((sign * right)[RIGHT], abs=0.01)


def test_the_waist_stands_where_it_is_told_and_the_wrists_stay(reach: Reach) -> None:
    home = reach.forward(HOME)
    reached = settle(reach, home, waist=0.4)
    assert reached.q[0] == pytest.approx(0.4, abs=1e-3)
    assert reached.reachable[:, :3] == pytest.approx(home[:, :3], abs=0.002)


def test_the_waist_helps_only_when_it_may(reach: Reach) -> None:
    far = moved(reach.forward(HOME), 0, 0.35, -0.25, 0.2)
    fixed = settle(reach, far)
    helped = settle(Reach(ROBOT, use_waist=True), far)
    assert abs(fixed.q[0]) < 1e-3
    assert helped.q[0] < -0.05, "the left shoulder comes forward"
    assert helped.error[0, 0] < fixed.error[0, 0] - 0.005


def test_a_dragged_wrist_lags_less_than_60_ms(reach: Reach) -> None:
    target, speed = reach.forward(HOME), np.array([0.0, 0.5, 0.0])
    for _ in range(20):
        target[0, :3] += speed * 0.02
        reached = reach.solve(target)
    assert reached.error[0, 0] < 0.5 * 0.06


def test_an_overlapping_body_comes_apart(reach: Reach) -> None:
    crossed = HOME.copy()
    crossed[[3, 10]] = -1.2, 1.2
    reach.reset(crossed)
    before = reach._model.clearance()
    assert before < -0.005, "the hands start inside each other"
    settle(reach, reach.forward(HOME), seconds=1)
    assert reach._model.clearance() >= 0.004
