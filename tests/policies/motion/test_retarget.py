"""From a person to the H1: angles by hand, limits, speeds, mirror, and the robot's own body."""

from pathlib import Path

import numpy as np
import pytest

from policies.motion import g1
from policies.motion.arms import Arms
from policies.motion.clear import Clear
from policies.motion.errors import UnreadableMotion
from policies.motion.person import Person, rotation
from policies.motion.retarget import Retargeter
from policies.motion.smooth import bound_speed, low_pass, resample
from robots.catalog import load

ROBOT = load("h1")
SPEC = ROBOT.spec
GROUP = SPEC.group("waist", "arms")
ARMS = Arms.of(SPEC)
LEFT, RIGHT = slice(1, 8), slice(8, 15)


@pytest.fixture(scope="module")
def retargeter() -> Retargeter:
    return Retargeter(ROBOT)


def g1_rows(frames: int = 180, seed: int = 0, reach: float = 0.5, hertz: float = 0.7) -> np.ndarray:
    """A G1 that walks a curve and waves its arms smoothly."""
    rng = np.random.default_rng(seed)
    time = np.arange(frames)[:, None] / g1.RATE
    waves = np.sin(2 * np.pi * hertz * (time + rng.random(29))) * reach
    middle = np.zeros(29)
    middle[16], middle[23], middle[[18, 25]] = 0.6, -0.6, 0.3
    yaw = 0.5 * time
    pose = np.concatenate([0.6 * np.sin(yaw), 0.6 * (1 - np.cos(yaw)), 0 * yaw + 0.79], 1)
    turn = np.concatenate([0 * yaw, 0 * yaw, np.sin(yaw / 2), np.cos(yaw / 2)], 1)
    return np.concatenate([pose, turn, middle + waves], 1)


def person(rows: np.ndarray, folder: Path) -> Person:
    path = folder / "g1.csv"
    np.savetxt(path, rows, delimiter=",")
    return g1.read(path)


def test_hanging_arms_with_forearms_forward_are_the_robots_zero() -> None:
    still = np.zeros((5, 2))
    eye = np.broadcast_to(np.eye(3), (5, 2, 3, 3))
    who = Person(60.0, still[:, 0], eye, still + np.pi / 2, eye, np.zeros((5, 3)), still[:, 0], 1.0, np.zeros((5, 2, 3)))
    np.testing.assert_allclose(ARMS.solve(who), 0, atol=1e-9)


def test_an_arm_raised_sideways_is_a_quarter_turn_of_the_roll() -> None:
    sideways = np.stack([rotation(0, np.array(np.pi / 2)), rotation(0, np.array(-np.pi / 2))])
    upper = np.broadcast_to(sideways, (3, 2, 3, 3))
    eye, still = np.broadcast_to(np.eye(3), (3, 2, 3, 3)), np.zeros((3, 2))
    who = Person(60.0, still[:, 0], upper, still, eye, np.zeros((3, 3)), still[:, 0], 1.0, np.zeros((3, 2, 3)))
    q = ARMS.solve(who)[0]
    np.testing.assert_allclose(q[LEFT], [0, np.pi / 2, 0, np.pi / 2, 0, 0, 0], atol=1e-9)
    np.testing.assert_allclose(q[RIGHT], [0, -np.pi / 2, 0, np.pi / 2, 0, 0, 0], atol=1e-9)


def test_closed_form_gives_back_the_angles_it_was_made_from() -> None:
    rng = np.random.default_rng(0)
    q = rng.uniform(0.9 * SPEC.lower[GROUP], 0.9 * SPEC.upper[GROUP], (200, 15))
    arm = q[:, 1:].reshape(-1, 2, 7)
    hand = rotation(0, arm[..., 4]) @ rotation(1, arm[..., 5]) @ rotation(2, arm[..., 6])
    who = Person(60.0, q[:, 0], ARMS.upper_arm(q), np.pi / 2 - arm[..., 3], hand, np.zeros((200, 3)), q[:, 0], 1.0, np.zeros((200, 2, 3)))
    found = ARMS.solve(who)
    np.testing.assert_allclose(ARMS.upper_arm(found), ARMS.upper_arm(q), atol=1e-9)  # the shoulder has two solutions
    np.testing.assert_allclose(found[:, [4, 5, 6, 7, 11, 12, 13, 14]], q[:, [4, 5, 6, 7, 11, 12, 13, 14]], atol=1e-9)


def test_upper_arms_agree_with_the_model_in_physics(retargeter: Retargeter) -> None:
    import mujoco

    model = ROBOT.model("training")
    data = mujoco.MjData(model)
    q = np.random.default_rng(3).uniform(0.8 * SPEC.lower[GROUP], 0.8 * SPEC.upper[GROUP])
    data.qpos[3] = 1
    for name, angle in zip(SPEC.motor_names[GROUP], q, strict=True):
        data.qpos[model.joint(name).qposadr[0]] = angle
    mujoco.mj_kinematics(model, data)
    torso = data.body("torso_link").xmat.reshape(3, 3)
    for side, name in enumerate(("left", "right")):
        upper = data.body(f"{name}_shoulder_yaw_link").xmat.reshape(3, 3)
        np.testing.assert_allclose(torso.T @ upper, ARMS.upper_arm(q)[side], atol=1e-6)


def test_a_g1_keeps_the_direction_of_its_upper_arms(retargeter: Retargeter, tmp_path: Path) -> None:
    who = person(g1_rows(hertz=0.3), tmp_path)
    made = retargeter(who)
    at = np.round(np.arange(len(made.q)) / SPEC.policy_rate * who.rate).astype(int)
    angle = np.arccos(np.clip((ARMS.upper_arm(made.q)[..., 2] * who.upper_arm[at, :, :, 2]).sum(-1), -1, 1))
    assert np.degrees(np.median(angle)) < 2
    assert made.wrist_error < 0.01


def test_the_base_walks_forward_and_turns_left(retargeter: Retargeter, tmp_path: Path) -> None:
    made = retargeter(person(g1_rows(frames=600), tmp_path))
    middle = made.twist[150:-150]
    np.testing.assert_allclose(middle[:, 0], 0.3 * 0.8 / g1.LEG, atol=0.02)  # 0.3 m/s on the G1's legs
    np.testing.assert_allclose(middle[:, 1], 0, atol=0.02)
    np.testing.assert_allclose(middle[:, 2], 0.5, atol=0.02)
    np.testing.assert_allclose(made.height, 1.0, atol=1e-3)


def test_a_mirrored_person_makes_a_mirrored_motion(retargeter: Retargeter, tmp_path: Path) -> None:
    rows = g1_rows()
    sign = np.array([1, -1, -1, 1, -1, 1, -1])
    twin = rows.copy()
    twin[:, [1, 3, 5]] *= -1
    twin[:, g1.WAIST] *= -1
    twin[:, 22:29], twin[:, 29:36] = rows[:, 29:36] * sign, rows[:, 22:29] * sign
    one, other = retargeter(person(rows, tmp_path)), retargeter(person(twin, tmp_path))
    permutation, signs = SPEC.mirror
    np.testing.assert_allclose(other.q, one.q[:, permutation[GROUP] - GROUP.start] * signs[GROUP], atol=2e-3)
    np.testing.assert_allclose(other.twist, one.twist * [1, -1, -1], atol=1e-9)


def test_wild_motion_stays_within_limits_and_speeds(retargeter: Retargeter, tmp_path: Path) -> None:
    made = retargeter(person(g1_rows(reach=2.5, hertz=1.5, seed=4), tmp_path))
    assert made.mended > 0
    assert (made.q >= SPEC.lower[GROUP]).all()
    assert (made.q <= SPEC.upper[GROUP]).all()
    assert (np.abs(np.diff(made.q, axis=0)) * SPEC.policy_rate <= SPEC.velocity[GROUP] + 1e-6).all()


def test_hands_are_kept_out_of_the_body() -> None:
    clear = Clear(ROBOT)
    swing = np.sin(np.linspace(0, 6, 150))[:, None]
    q = np.zeros((150, 15)) + 0.15 * swing
    q[:, [4, 11]] = 1.5  # forearms down
    q[:, [2, 9]] = [-0.1, 0.1]  # elbows in
    before, moved = clear.overlaps(q), clear(q, 50.0)
    assert before.max() > 0.02
    assert clear.overlaps(moved).max() < 0.002
    assert np.abs(np.diff(moved, 2, axis=0)).max() < 0.03  # no jerk where the correction sets in
    assert (moved[:, 0] == q[:, 0]).all()


def test_clear_arms_are_left_alone() -> None:
    q = np.tile(SPEC.home[GROUP], (30, 1))
    q[:, [2, 9]] += [0.4, -0.4]
    np.testing.assert_array_equal(Clear(ROBOT)(q, 50.0), q)


def test_speed_bound_holds_without_delay() -> None:
    x = np.where(np.arange(101) < 50, 0.0, 1.0)[:, None]
    y = bound_speed(x, np.array([0.05]))
    assert np.abs(np.diff(y, axis=0)).max() <= 0.05 + 1e-12
    assert y[[0, -1], 0] == pytest.approx([0, 1])
    assert np.searchsorted(y[:, 0], 0.5) == pytest.approx(50, abs=1)  # half-way where the step was


def test_low_pass_and_resampling_keep_slow_curves() -> None:
    time = np.arange(120) / 60
    slow = np.sin(2 * np.pi * time)[:, None]
    np.testing.assert_allclose(low_pass(slow, 60, 6.0)[10:-10], slow[10:-10], atol=5e-3)
    np.testing.assert_allclose(resample(slow, 60, 50)[:, 0], np.sin(2 * np.pi * np.arange(100) / 50), atol=1e-4)


@pytest.mark.parametrize(
    ("text", "reason"),
    [("1,2,3\n4,5,6\n", "36 columns"), ("a,b\n", "not a readable CSV"), (("0," * 35 + "0\n") * 3, "unit quaternions")],
)
def test_a_csv_that_is_no_g1_motion_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "odd.csv"
    path.write_text(text)
    with pytest.raises(UnreadableMotion, match=reason):
        g1.read(path)
