"""A robot in the mirror must look like, and be paid like, the mirrored robot: the networks rely on it."""

import numpy as np
import pytest
import torch

from policies.gait import Gait
from policies.networks import Actor, Critic
from policies.observation import TURN, VECTOR, Mirror, Observer, action_mirror, joint_mirror, layout
from policies.ppo.algorithm import settle
from policies.ppo.env import privileged_mirror
from policies.ppo.rewards import Moment, Rewards
from policies.stance import Stance
from robots import catalog
from robots.state import State

COUNT = 40
SPEC = catalog.load("h1").spec
TWIST, POSTURE = Mirror.signs(1, -1, -1), Mirror.signs(1, -1, 1)
LEGS = action_mirror(SPEC)


def random_state(rng: np.random.Generator) -> State:
    quaternion = np.array([1, 0, 0, 0]) + 0.2 * rng.standard_normal((COUNT, 4))
    return State(
        time=np.zeros(COUNT),
        position=rng.standard_normal((COUNT, 3)) * [1, 1, 0.02] + [0, 0, 1],
        quaternion=quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True),
        velocity=rng.standard_normal((COUNT, 3)),
        gyro=rng.standard_normal((COUNT, 3)),
        q=SPEC.home[:27] + 0.2 * rng.standard_normal((COUNT, 27)),
        dq=rng.standard_normal((COUNT, 27)),
        feet=np.array([[0.05, 0.12, -1.0], [0.05, -0.12, -1.0]]) + 0.03 * rng.standard_normal((COUNT, 2, 3)),
        feet_velocity=0.3 * rng.standard_normal((COUNT, 2, 3)),
        touch=rng.choice([0.0, 300.0], (COUNT, 2)),
    )


def mirrored(s: State) -> State:
    body = joint_mirror(SPEC, slice(0, 27))
    return State(
        time=s.time,
        position=VECTOR(s.position),
        quaternion=s.quaternion * [1, -1, 1, -1],
        velocity=VECTOR(s.velocity),
        gyro=TURN(s.gyro),
        q=body(s.q),
        dq=body(s.dq),
        feet=VECTOR(s.feet)[:, ::-1],
        feet_velocity=VECTOR(s.feet_velocity)[:, ::-1],
        touch=s.touch[:, ::-1],
    )


def test_the_observation_of_the_mirrored_robot_is_the_mirrored_observation():
    rng = np.random.default_rng(0)
    one, other = Observer(SPEC, COUNT), Observer(SPEC, COUNT)
    gait, twin = Gait(COUNT, 0.02), Gait(COUNT, 0.02)
    mirror = Mirror.stack(list(layout(SPEC).values()))
    latent = Mirror.pairs(32, 1)
    for _ in range(60):
        s = random_state(rng)
        twist, posture, action = rng.standard_normal((COUNT, 3)), rng.standard_normal((COUNT, 3)), rng.standard_normal((COUNT, 12))
        z = rng.standard_normal((COUNT, 64)).astype(np.float32)
        gait.step(s, twist)
        twin.step(mirrored(s), TWIST(twist))
        stance = rng.standard_normal((COUNT, 12))
        seen = one.observe(s, gait, twist, posture, stance, action, z)
        in_mirror = other.observe(mirrored(s), twin, TWIST(twist), POSTURE(posture), LEGS(stance), LEGS(action), latent(z))
        np.testing.assert_allclose(in_mirror, mirror(seen), atol=2e-5)


def test_a_mirrored_robot_earns_the_same():
    rng = np.random.default_rng(1)
    rewards, gait, twin = Rewards(SPEC), Gait(COUNT, 0.02), Gait(COUNT, 0.02)
    for _ in range(30):
        s, twist = random_state(rng), rng.standard_normal((COUNT, 3)) * (rng.random((COUNT, 1)) < 0.7)
        gait.step(s, twist)
        twin.step(mirrored(s), TWIST(twist))
        posture, error = rng.standard_normal((2, COUNT, 3))
        actions, acceleration = rng.standard_normal((3, COUNT, 12)), rng.standard_normal((COUNT, 12))
        shoved = rng.random(COUNT) < 0.5
        stance = rng.standard_normal((COUNT, 12))
        there = Moment(s, gait, twist, posture, stance, error, tuple(actions), acceleration, shoved)
        here = Moment(
            mirrored(s),
            twin,
            TWIST(twist),
            POSTURE(posture),
            LEGS(stance),
            TWIST(error),
            tuple(LEGS(a) for a in actions),
            LEGS(acceleration),
            shoved,
        )
        for kind in (rewards.tasks, rewards.penalties):
            for name, value in kind(there).items():
                np.testing.assert_allclose(kind(here)[name], value, atol=1e-9, err_msg=name)


def test_the_stance_of_a_mirrored_posture_is_the_mirrored_stance():
    stance, posture = Stance(catalog.load("h1")), np.random.default_rng(2).uniform([0.8, -0.2, -0.2], [1.02, 0.2, 0.2], (COUNT, 3))
    np.testing.assert_allclose(stance(POSTURE(posture)), LEGS(stance(posture)), atol=1e-9)


def test_networks_cannot_tell_left_from_right():
    torch.manual_seed(0)
    mirror = Mirror.stack(list(layout(SPEC).values()))
    whole = Mirror.stack([mirror, privileged_mirror(SPEC)])
    actor, critic = Actor(mirror, LEGS), Critic(whole)
    x, y = torch.randn(COUNT, len(mirror.sign)), torch.randn(COUNT, len(whole.sign))
    settle(actor.normaliser, actor.inputs(x))
    settle(critic.normaliser, critic.inputs(y))
    with torch.no_grad():
        action, value = actor(x), critic.value(critic.features(y))
        np.testing.assert_allclose(actor(torch.tensor(mirror(x.numpy())).float()), LEGS(action.numpy()), atol=1e-6)
        np.testing.assert_allclose(critic.value(critic.features(torch.tensor(whole(y.numpy())).float())), value, atol=1e-5)
    assert value.std() > 0.01
    assert np.abs(actor.deviation().detach().numpy() - LEGS(actor.deviation().detach().numpy()) * LEGS.sign).max() == 0


@pytest.mark.parametrize("part", list(layout(SPEC)))
def test_every_mirror_undoes_itself(part):
    mirror = layout(SPEC)[part]
    x = np.arange(len(mirror.sign)) + 1.0
    assert (mirror(mirror(x)) == x).all()
