"""The stepped robot: replay, divergence, fingers that follow, and the fleet that must move like it."""

import mujoco
import numpy as np
import pytest

from robots import catalog
from robots.batch import Fleet
from robots.errors import PhysicsDiverged
from robots.h1.spec import H1
from robots.plant import Plant
from robots.target import Target

ROBOT = catalog.load("h1")


@pytest.fixture(scope="module")
def plant() -> Plant:
    return Plant(ROBOT)


@pytest.fixture(autouse=True)
def _standing(plant: Plant):
    plant.reset()


def wandering(ticks: int, motors: int, seed: int = 0) -> np.ndarray:
    """Targets around home that a robot can follow [ticks, motors]."""
    steps = np.random.default_rng(seed).normal(scale=0.03, size=(ticks, motors))
    return np.clip(H1.home[:motors] + np.cumsum(steps, axis=0), H1.lower[:motors], H1.upper[:motors])


def test_one_step_is_one_policy_tick(plant):
    state = plant.step(Target(H1.home))
    assert state.time == pytest.approx(1 / H1.policy_rate)
    assert state.q.shape == state.dq.shape == (41,)
    np.testing.assert_allclose(state.q, H1.home, atol=0.02)


def test_a_standing_robot_senses_its_weight_and_its_feet(plant):
    for _ in range(10):
        state = plant.step(Target(H1.home))
    weight = 9.81 * plant.model.body_mass.sum()
    assert state.touch.sum() == pytest.approx(weight, rel=0.15)
    np.testing.assert_allclose(state.feet[0], state.feet[1] * (1, -1, 1), atol=5e-3)
    np.testing.assert_allclose(state.feet[:, 2], -state.position[2], atol=0.02)


def test_a_seed_draws_a_start_near_home_and_always_the_same_one(plant):
    home, one, again, other = (plant.reset(seed) for seed in (0, 7, 7, 8))
    np.testing.assert_array_equal(one.q, again.q)
    np.testing.assert_array_equal(one.position, again.position)
    assert not np.array_equal(one.q, other.q)
    legs = H1.group("legs")
    np.testing.assert_array_equal(one.q[legs], home.q[legs])
    assert 0 < np.abs(one.q - home.q).max() <= 0.12
    assert 0 < np.linalg.norm(one.position - home.position) < 0.22
    assert 0 < abs(one.yaw) < 0.36
    np.testing.assert_allclose(one.gravity, (0, 0, -1), atol=1e-12)


def test_save_and_restore_replays_bit_for_bit(plant):
    targets = wandering(30, 41)
    for q in targets[:10]:
        plant.step(Target(q))
    saved = plant.save()
    first = [plant.step(Target(q)) for q in targets[10:]]
    other = Plant(ROBOT)
    for q in targets:  # a past that must leave no trace
        other.step(Target(q[::-1].clip(H1.lower, H1.upper)))
    restored = other.restore(saved)
    assert restored.time == pytest.approx(10 / H1.policy_rate)
    second = [other.step(Target(q)) for q in targets[10:]]
    for one, two in zip(first, second, strict=True):
        for field in ("time", "position", "quaternion", "velocity", "gyro", "q", "dq", "feet", "touch"):
            np.testing.assert_array_equal(getattr(one, field), getattr(two, field))
    np.testing.assert_array_equal(plant.save(), other.save())


def test_reset_forgets_everything(plant):
    fresh = plant.save()
    for q in wandering(10, 41):
        plant.step(Target(q))
    plant.reset()
    np.testing.assert_array_equal(plant.save(), fresh)


@pytest.mark.parametrize(
    ("array", "value"), [("qvel", np.nan), ("qpos", np.inf), ("qvel", 1e12), ("qfrc_applied", np.nan), ("ctrl", np.nan)]
)
def test_a_divergence_is_raised_and_a_reset_cures_it(plant, array, value):
    target = H1.home.copy()
    if array == "ctrl":
        target[3] = value
    else:
        getattr(plant.data, array)[10] = value
    with pytest.raises(PhysicsDiverged, match=r"t = 0.00 s"):
        plant.step(Target(target))
    plant.reset()
    assert np.isfinite(plant.step(Target(H1.home)).q).all()


def test_following_finger_joints_keep_their_ratio(plant):
    plant.model.opt.gravity[2] = 0
    try:
        target = H1.home.copy()
        target[H1.group("hands")] = H1.upper[H1.group("hands")]
        worst = 0.0
        for tick in range(60):
            plant.step(Target(target))
            if tick > 10:
                worst = max(worst, *(abs(follow_error(plant, j)) for j in H1.joints if j.mimic))
        closed = plant.data.qpos[plant.model.joint("L_index_proximal_joint").qposadr[0]]
    finally:
        plant.model.opt.gravity[2] = -9.81
    assert closed > 1.5
    assert worst < 0.05


def follow_error(plant: Plant, joint) -> float:
    leader, ratio = joint.mimic
    at = {name: plant.model.joint(name).qposadr[0] for name in (joint.name, leader)}
    return plant.data.qpos[at[joint.name]] - ratio * plant.data.qpos[at[leader]]


def test_a_fleet_moves_like_one_robot():
    plant, fleet = Plant(ROBOT, "training"), Fleet(ROBOT, 3, threads=1)
    fleet.reset(np.ones(3, dtype=bool))
    for q in wandering(40, 27):
        alone = plant.step(Target(q))
        together = fleet.step(np.tile(q, (3, 1)))
        for field in ("time", "position", "quaternion", "velocity", "gyro", "q", "dq", "feet", "feet_velocity", "touch"):
            for row in range(3):
                np.testing.assert_allclose(getattr(together, field)[row], getattr(alone, field), atol=1e-9, err_msg=field)
    assert fleet.finite.all()


def test_a_fleet_resets_only_the_robots_of_the_mask():
    fleet = Fleet(ROBOT, 3, threads=1)
    everyone = np.ones(3, dtype=bool)
    fleet.reset(everyone)
    for q in wandering(5, 27):
        fleet.step(np.tile(q, (3, 1)))
    before = fleet.qpos.copy()
    fleet.reset(np.array([False, True, False]))
    np.testing.assert_array_equal(fleet.qpos[[0, 2]], before[[0, 2]])
    np.testing.assert_array_equal(fleet.qpos[1], fleet.model.key("home").qpos)
    assert fleet.time.ravel()[1] == 0


def test_a_fleet_names_the_robot_that_diverged():
    fleet = Fleet(ROBOT, 3, threads=1)
    fleet.reset(np.ones(3, dtype=bool))
    fleet.qvel[2, 8] = np.nan
    fleet.step(np.tile(H1.home[:27], (3, 1)))
    np.testing.assert_array_equal(fleet.finite, [True, True, False])


def test_a_fallen_robot_lies_on_the_floor(plant):
    plant.data.qpos[:7] = (0, 0, 0.6, np.cos(0.7), 0, np.sin(0.7), 0)  # face down, above the floor
    mujoco.mj_forward(plant.model, plant.data)
    for _ in range(75):
        plant.step(Target(H1.home))
    lowest = plant.data.geom_xpos[plant.model.geom("torso").id, 2]
    assert 0.05 < lowest < 0.4
