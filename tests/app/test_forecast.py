"""What the page is told of the prior's expectation: the same z as the legs see, the same arms as the robot's, judged by what came."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from app.outputs.forecast import EVERY, Forecast, Forecaster
from app.shared import Memory, Ring, snapshot_dtype
from policies.observation import LATENT
from policies.prior.history import WINDOW
from policies.prior.latent import Latent
from policies.prior.prior import Prior
from robots.catalog import load

ROBOT = load("h1")
GROUP = ROBOT.spec.group("waist", "arms")
HOME = ROBOT.spec.home[GROUP]
TYPE = snapshot_dtype(7, len(HOME))


class Simulated:
    """Arms that swing, tick by tick, and somebody who watches."""

    def __init__(self) -> None:
        memory = Memory()
        self.ring = Ring(memory.map(Ring.size(TYPE, 512)), TYPE, 512)
        self.watcher = Forecaster(ROBOT, ("with", "without"), ("prior_h1", None), self.ring)
        self.tick = 0

    def targets(self, tick: int) -> np.ndarray:
        swing = np.zeros(len(HOME))
        swing[[1, 4, 8, 11]] = 0.4 * np.sin(2 * np.pi * tick / 100)
        return HOME + swing

    def run(self, ticks: int, policy: int = 0, jump: bool = False, still: bool = False) -> Forecast:
        """The forecast after so many ticks, asked for all along."""
        for _ in range(ticks):
            record = np.zeros((), TYPE)
            record["policy"], record["jump"], jump = policy, jump, False
            record["upper"] = HOME if still else self.targets(self.tick)
            self.ring.push(record)
            self.tick += 1
            told = self.watcher.now()
        return told


@pytest.fixture
def simulated() -> Simulated:
    return Simulated()


def test_it_is_the_decoder_of_what_the_legs_see(simulated):
    prior = Prior.load("prior_h1", ROBOT.spec)
    latent = Latent(ROBOT.spec, prior)
    latent.reset(np.ones(1, bool), simulated.targets(0)[None])
    for tick in range(3 * WINDOW + 1):
        z = latent.step(simulated.targets(tick)[None])
    assert z.shape == (1, LATENT)
    told = simulated.run(3 * WINDOW + 1)
    past = np.array([simulated.targets(tick) for tick in range(2 * WINDOW + 1, 3 * WINDOW + 1)])
    np.testing.assert_allclose(prior.encode(past), z[0], atol=1e-4)
    coming = prior.predict(past[None])[0]
    model = ROBOT.model("play")
    data = mujoco.MjData(model)
    at = [model.joint(name).qposadr[0] for name in ROBOT.spec.motor_names[GROUP]]
    for i, q in enumerate([past[-1], *coming[EVERY - 1 :: EVERY]]):
        data.qpos[:] = model.key("home").qpos
        data.qpos[at] = q
        mujoco.mj_kinematics(model, data)
        turn, pelvis = data.body("pelvis").xmat.reshape(3, 3), data.body("pelvis").xpos
        for told_of, site in zip((told.left, told.right), ROBOT.spec.wrists, strict=True):
            assert told_of is not None
            np.testing.assert_allclose(told_of.path[i], (data.site(site).xpos - pelvis) @ turn, atol=2e-4)
            if i == WINDOW // 2 // EVERY:
                assert told_of.pose.position == told_of.path[i]
    assert told.left is not None
    assert len(told.left.path) == WINDOW // EVERY + 1


def test_it_is_judged_by_what_came(simulated):
    assert simulated.run(20).error is None
    told = simulated.run(300)
    assert told.error is not None
    assert told.still is not None
    assert told.still > 0.05, "half a swing is far"
    assert told.error < 0.8 * told.still
    calm = simulated.run(600, still=True)
    assert calm.still == 0


def test_legs_without_a_prior_expect_nothing(simulated):
    simulated.run(300)
    told = simulated.run(1, policy=1)
    assert (told.policy, told.prior, told.left, told.error) == ("without", None, None, None)
    told = simulated.run(1, policy=0)
    assert told.prior == "prior_h1"
    assert told.left is not None
    assert told.error is None, "what was expected before is forgotten"


def test_a_robot_that_was_put_elsewhere_is_not_judged_by_its_past(simulated):
    simulated.run(300)
    assert simulated.run(1, jump=True, still=True).error is None
    told = simulated.run(1, still=True)
    assert told.left is not None
    np.testing.assert_allclose(told.left.path[0], told.left.path[-1], atol=0.06)


def test_a_watcher_who_comes_back_sees_the_last_second(simulated):
    simulated.run(100)
    record = np.zeros((), TYPE)
    for tick in range(1000):
        record["upper"] = simulated.targets(simulated.tick + tick)
        simulated.ring.push(record)
    simulated.tick += 1000
    other = Simulated()
    other.tick = simulated.tick - WINDOW - 1  # its forecast at the last tick is fresh
    told, wanted = simulated.watcher.now(), other.run(WINDOW + 1)
    assert (told.left, told.right) == (wanted.left, wanted.right)
    assert told.error is None
