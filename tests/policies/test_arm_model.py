"""Distances and gradients that the arms' inverse kinematics relies on."""

import mujoco
import numpy as np
import pytest

from policies.arm_model import SIGHT, ArmModel
from robots.catalog import load

ROBOT = load("h1")
GROUP = ROBOT.spec.group("waist", "arms")
STEP = 1e-6


@pytest.fixture(scope="module")
def model() -> ArmModel:
    return ArmModel(ROBOT)


def postures(count: int) -> np.ndarray:
    rng = np.random.default_rng(1)
    return rng.uniform(ROBOT.spec.lower[GROUP], ROBOT.spec.upper[GROUP], (count, 15))


def test_the_jacobian_says_how_errors_shrink(model: ArmModel) -> None:
    for q in postures(5):
        model.pose(q)
        target, jacobian = model.wrists(), model.jacobian().copy()
        for joint in range(15):
            model.pose(q + STEP * (np.arange(15) == joint))
            assert -model.errors(target) / STEP == pytest.approx(jacobian[:, joint], abs=1e-4)


def test_obstacle_gradients_say_how_distances_grow(model: ArmModel) -> None:
    checked = 0
    for q in postures(20):
        model.place(q)
        distance, gradient = (row.copy() for row in model.obstacles())
        for joint in range(15):
            model.place(q + STEP * (np.arange(15) == joint))
            moved = model.obstacles()[0]
            if len(moved) == len(distance):  # none came into sight
                assert (moved - distance) / STEP == pytest.approx(gradient[:, joint], abs=1e-3)
                checked += len(distance)
    assert checked > 500


def test_distances_are_those_between_the_capsules_of_the_physics_model(model: ArmModel) -> None:
    physics = ROBOT.model("training")
    data = mujoco.MjData(physics)
    mujoco.mj_resetDataKeyframe(physics, data, physics.key("home").id)
    at = [physics.joint(name).qposadr[0] for name in ROBOT.spec.motor_names[GROUP]]
    legs = {"thigh", "shank", "foot"}
    pairs = [
        (a, b)
        for a, b in zip(physics.pair_geom1, physics.pair_geom2, strict=True)
        if not all(physics.geom(g).name.split("_")[-1] in legs for g in (a, b))
    ]
    assert len(pairs) > 60
    for q in postures(20):
        data.qpos[at] = q
        mujoco.mj_kinematics(physics, data)
        model.place(q)
        nearest = min(mujoco.mj_geomDistance(physics, data, int(a), int(b), SIGHT, None) for a, b in pairs)
        assert model.clearance() == pytest.approx(nearest, abs=1e-9)


def test_each_arm_has_seven_joints_of_its_own_and_shares_the_waist(model: ArmModel) -> None:
    assert model.arms.sum(1).tolist() == [8, 8]
    assert np.flatnonzero(model.arms.all(0)).tolist() == [0]
