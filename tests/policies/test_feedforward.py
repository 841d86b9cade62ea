"""Soft motors bring the arms where they shall be: at rest, in motion, struck, and however the pelvis hangs."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from policies.arm_model import ArmModel
from policies.feedforward import SHOCK, Feedforward
from policies.reach import Reach
from robots.catalog import load
from robots.state import GRAVITY, State

ROBOT = load("h1")
SPEC = ROBOT.spec
GROUP = SPEC.group("waist", "arms")
HOME = SPEC.home[GROUP]
RAISED = HOME.copy()
RAISED[[1, 8]] -= 0.6


class Hung:
    """The robot hung up by its pelvis, arms simulated."""

    def __init__(self, lean: float = 0.0) -> None:
        """lean: of the pelvis about its forward axis [rad]."""
        spec = ROBOT.build("training")
        spec.compiler.fusestatic = False
        for row in [*spec.keys, *(j for j in spec.joints if j.type == mujoco.mjtJoint.mjJNT_FREE)]:
            spec.delete(row)
        spec.body("pelvis").pos = 0, 0, 2
        spec.body("pelvis").quat = np.cos(lean / 2), np.sin(lean / 2), 0, 0
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        joints = [self.model.joint(name) for name in SPEC.motor_names[: self.model.nu]]
        self._q, self.dofs = [joint.qposadr[0] for joint in joints], [joint.dofadr[0] for joint in joints]
        self.data.qpos[self._q] = self.data.ctrl[:] = SPEC.home[: self.model.nu]

    @property
    def state(self) -> State:
        """Of one robot, [1, ...]."""
        data, none = self.data, np.zeros((1, 3))
        return State(
            np.array([data.time]), none, data.body("pelvis").xquat[None], none, none, data.qpos[self._q][None], data.qvel[self.dofs][None],
            np.zeros((1, 2, 3)), np.zeros((1, 2, 3)), np.zeros((1, 2)),
        )  # fmt: skip

    def step(self, arms: np.ndarray) -> np.ndarray:
        """One tick; returns the arms' angles [15]."""
        self.data.ctrl[GROUP] = arms
        mujoco.mj_step(self.model, self.data, nstep=4)
        return self.data.qpos[self._q][GROUP]

    def hold(self, q: np.ndarray, ticks: int, helped: bool = True) -> np.ndarray:
        """The arms' angles [15] after so many ticks with these targets."""
        feedforward, actual = Feedforward(ROBOT), q
        mujoco.mj_kinematics(self.model, self.data)
        for _ in range(ticks):
            actual = self.step(feedforward.step(q[None], self.state)[0] if helped else q)
        return actual


def gap(q: np.ndarray, wanted: np.ndarray) -> float:
    """Largest distance of a wrist from where the wanted angles put it [m]."""
    places = []
    for angles in (q, wanted):
        ARMS.pose(angles)
        places.append(ARMS.wrists()[:, :3])
    return float(np.linalg.norm(places[0] - places[1], axis=1).max())


ARMS = ArmModel(ROBOT)


@pytest.mark.parametrize("lean", [0.0, 0.5, np.pi])
def test_the_wrists_do_not_sag_however_the_pelvis_leans(lean: float) -> None:
    assert gap(Hung(lean).hold(RAISED, 200, helped=False), RAISED) > 0.015
    assert gap(Hung(lean).hold(RAISED, 200), RAISED) < 0.001


def test_moving_wrists_are_there_in_time() -> None:
    reach, hung, feedforward = Reach(ROBOT), Hung(), Feedforward(ROBOT)
    hung.hold(HOME, 150)
    target = home = reach.forward(HOME)
    for tick in range(50):
        target = home.copy()
        target[0, :3] += np.array([0.15, 0.05, 0.2]) * min(1.0, tick / 15)
        actual = hung.step(feedforward.step(reach.solve(target).q[None], hung.state)[0])
    assert np.linalg.norm(reach.forward(actual)[:, :3] - target[:, :3], axis=1).max() < 0.01


def test_an_arm_that_was_struck_is_calmed_by_what_is_measured() -> None:
    swing = {}
    for calmed in (False, True):
        hung, feedforward = Hung(), Feedforward(ROBOT)
        rest = hung.hold(HOME, 100)
        known = hung.data.ctrl[GROUP].copy()  # what holds it there, measured or not
        hung.data.qvel[[hung.dofs[GROUP][i] for i in (1, 8)]] = 3.0
        swing[calmed] = 0.0
        for tick in range(50):
            actual = hung.step(feedforward.step(HOME[None], hung.state)[0] if calmed else known)
            if tick > 25:
                swing[calmed] = max(swing[calmed], float(np.abs(actual - rest).max()))
    assert swing[False] > 0.02, "by itself it swings on"
    assert swing[True] < swing[False] / 4


def random_state(rng: np.random.Generator, count: int) -> State:
    hung = Hung().state
    many = State(**{name: np.repeat(value, count, 0) for name, value in vars(hung).items()})
    turn = [1, 0, 0, 0] + 0.2 * rng.standard_normal((count, 4))
    return replace(
        many,
        quaternion=turn / np.linalg.norm(turn, axis=-1, keepdims=True),
        velocity=0.1 * rng.standard_normal((count, 3)),
        q=many.q + 0.1 * rng.standard_normal(many.q.shape),
        dq=rng.standard_normal(many.dq.shape),
    )


def alone(state: State, i: int) -> State:
    return State(**{name: value[i : i + 1] for name, value in vars(state).items()})


def test_many_robots_are_told_what_each_would_be_told_alone_and_a_reset_one_what_a_new_one_is() -> None:
    rng = np.random.default_rng(0)
    together, single = Feedforward(ROBOT, 3), [Feedforward(ROBOT) for _ in range(3)]
    for tick in range(3):
        if tick == 2:
            together.reset(np.array([False, True, False]))
            single[1] = Feedforward(ROBOT)
        q, state = HOME + 0.01 * tick * rng.standard_normal((3, 15)), random_state(rng, 3)
        told = together.step(q, state)
        for i in range(3):
            np.testing.assert_allclose(told[i : i + 1], single[i].step(q[i : i + 1], alone(state, i)), atol=1e-12)


def test_a_pelvis_that_falls_freely_needs_nothing_held_and_a_blow_counts_up_to_its_bound() -> None:
    state, told = Hung().state, {}
    for lost in (0.0, 1.0, SHOCK + 4):  # g, downwards
        feedforward = Feedforward(ROBOT)
        feedforward.step(HOME[None], state)
        told[lost] = feedforward.step(HOME[None], replace(state, velocity=np.array([[0, 0, -lost * GRAVITY * 0.02]])))[0] - HOME
    assert np.abs(told[0.0]).max() > 0.01
    np.testing.assert_allclose(told[1.0], 0, atol=1e-9)
    np.testing.assert_allclose(told[SHOCK + 4], told[1.0], atol=1e-9)


def test_targets_keep_the_joint_limits() -> None:
    state = Hung().state
    assert (Feedforward(ROBOT).step(SPEC.upper[GROUP][None], replace(state, dq=state.dq - 50)) <= SPEC.upper[GROUP]).all()
