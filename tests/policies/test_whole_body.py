"""The shipped weights on the play model: the robot stands still, walks, stops, and its wrists go where they are told."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from policies import feedforward
from policies.arm_model import ArmModel
from policies.command import Command
from policies.whole_body import WholeBody
from robots import catalog
from robots.plant import Plant
from robots.state import State


class Robot:
    """Plant and policy, driven by hand."""

    def __init__(self) -> None:
        torch.set_num_threads(1)
        self.robot = catalog.load("h1")
        self.plant, self.policy = Plant(self.robot), WholeBody(self.robot, "walk_h1")
        self.state = self.plant.reset()
        self.policy.reset(self.state)
        self.home = replace(Command(), engage=True)

    def run(self, seconds: float, command: Command) -> list[State]:
        states = []
        for _ in range(round(50 * seconds)):
            self.state = self.plant.step(self.policy.act(self.state, command))
            states.append(self.state)
        return states


@pytest.fixture
def robot() -> Robot:
    return Robot()


def test_it_stands_still_without_a_step(robot):
    states = robot.run(6, robot.home)
    assert max(np.linalg.norm(s.position[:2]) for s in states) < 0.05
    assert all((s.touch > 0).all() for s in states[25:]), "both feet stay down"
    assert robot.state.position[2] == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("twist", [(0.5, 0, 0), (-0.3, 0, 0), (0, 0.3, 0), (0, 0, 0.5), (0.4, 0, -0.4)])
def test_it_goes_where_it_is_told_and_stops(robot, twist):
    states = robot.run(6, replace(robot.home, twist=np.array(twist, float)))[100:]
    velocity = np.mean([[*s.heading_velocity, float(s.yaw_rate)] for s in states], axis=0)
    np.testing.assert_allclose(velocity, twist, atol=0.12)
    states = robot.run(4, robot.home)[150:]
    assert max(np.linalg.norm(s.velocity[:2]) for s in states) < 0.1
    assert all((s.touch > 0).all() for s in states[-25:])


def test_wrists_arrive_within_a_second_while_standing(robot):
    robot.run(1, robot.home)
    wrists = robot.home.wrists + np.array([[0.08, 0.02, 0.15, 0, 0, 0, 0], [0.05, -0.02, 0.1, 0, 0, 0, 0]])
    robot.run(1, replace(robot.home, wrists=wrists))
    states = robot.run(1, replace(robot.home, wrists=wrists))
    data, pelvis = robot.plant.data, robot.plant.data.body("pelvis")
    for side, target in zip(robot.robot.spec.wrists, wrists, strict=True):
        actual = pelvis.xmat.reshape(3, 3).T @ (data.site(side).xpos - pelvis.xpos)
        assert np.linalg.norm(actual - target[:3]) < 0.01
    assert all((s.touch > 0).all() for s in states)


def test_what_the_pelvis_feels_keeps_the_wrists_quiet_under_steps(robot, monkeypatch):
    """Held at home while walking, as the wrists' distance from there in the pelvis frame [mm]."""
    sway = {}
    for felt in (1.0, 0.0):
        monkeypatch.setattr(feedforward, "SHOCK", felt)
        robot.policy.reset(robot.state)
        states = robot.run(4, replace(robot.home, twist=np.array([0.5, 0, 0])))[100:]
        arms, wanted = ArmModel(robot.robot), robot.home.wrists[:, :3]
        gaps = []
        for state in states:
            arms.pose(state.q[robot.robot.spec.group("waist", "arms")])
            gaps.append(np.linalg.norm(arms.wrists()[:, :3] - wanted, axis=1).mean())
        sway[felt] = 1e3 * np.mean(gaps)
    assert sway[1.0] < 0.8 * sway[0.0]
    assert sway[1.0] < 6


def test_it_crouches(robot):
    states = robot.run(5, replace(robot.home, height=0.88))[-25:]
    assert np.mean([s.position[2] for s in states]) == pytest.approx(0.88, abs=0.06)


@pytest.mark.parametrize(("field", "axis", "value"), [("roll", 0, 0.15), ("pitch", 1, 0.15)])
def test_it_leans_the_way_it_is_told(robot, field, axis, value):
    upright = robot.run(3, robot.home)[-1].roll_pitch[axis]
    leaning = np.mean([s.roll_pitch[axis] for s in robot.run(5, replace(robot.home, **{field: value}))[-25:]])
    assert leaning > upright + 0.01


def test_a_push_is_walked_off(robot):
    robot.run(1, robot.home)
    robot.plant.data.qvel[1] += 0.8
    robot.run(6, robot.home)
    assert robot.state.gravity[2] < -0.98
    assert np.linalg.norm(robot.state.velocity[:2]) < 0.1
