"""The learner: advantages by hand, KL by hand, and a training of seconds that learns, resumes and exports."""

import csv
import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import torch

from policies import checkpoint
from policies.errors import DamagedWeights, NothingToBeginWith, OtherMotions, WrongWeights
from policies.motion import reaches
from policies.ppo.algorithm import PPOConfig, advantages, log_prob
from policies.ppo.config import STAGES, WalkConfig
from policies.ppo.env import Stage, WalkEnv
from policies.ppo.train import train
from policies.ppo.trainer import Trainer
from policies.prior.errors import OtherTraining
from policies.prior.model import PriorModel
from policies.walk import Walk
from robots import catalog
from robots.batch import Fleet


def test_advantages_by_hand():
    # gamma .5, lambda .5, two ticks, the second robot's episode ends after the first tick
    rewards = torch.tensor([[1.0, 1.0], [2.0, 2.0]])
    values = torch.tensor([[0.5, 0.5], [1.0, 1.0]])
    ended = torch.tensor([[0.0, 1.0], [0.0, 0.0]])
    got = advantages(rewards, values, ended, last=torch.tensor([4.0, 4.0]), gamma=0.5, lam=0.5)
    second = 2 + 0.5 * 4 - 1  # 3
    assert got.tolist() == [[1 + 0.5 * 1 - 0.5 + 0.25 * second, 1 - 0.5], [second, second]]


def test_log_probability_is_that_of_a_gaussian():
    x, mean, deviation = torch.tensor([[0.3, -1.0]]), torch.tensor([[0.0, 0.5]]), torch.tensor([0.5, 2.0])
    expected = torch.distributions.Normal(mean, deviation).log_prob(x).sum(-1)
    torch.testing.assert_close(log_prob(x, mean, deviation), expected)


@pytest.fixture(scope="module")
def tiny(tmp_path_factory) -> WalkConfig:
    run = tmp_path_factory.mktemp("run")
    return WalkConfig(run=run, steps=2 * 16 * 8, count=16, threads=1, torch_threads=1, ppo=PPOConfig(horizon=8))


def test_a_training_of_seconds_resumes_and_exports_weights_that_walk_loads(tiny, capsys):
    path = train(tiny)
    longer = replace(tiny, steps=3 * 16 * 8)
    train(longer)
    rows = list(csv.DictReader((tiny.run / "curves.csv").read_text().splitlines()))
    assert [int(r["steps"]) for r in rows] == [128, 256, 384], "the third update continues the first two"
    robot = catalog.load("h1")
    walk = Walk(robot, str(path))
    assert walk.card["steps"] == 384
    assert walk.card["robot"] == "h1"


def test_weights_of_another_robot_are_refused(tiny):
    path = tiny.run / "walk.safetensors"
    tensors, card = checkpoint.load(path, {"kind": "walk"})
    other = tiny.run / "other.safetensors"
    checkpoint.save(other, tensors, card | {"robot": "gr1"})
    with pytest.raises(WrongWeights, match="'gr1', not 'h1'"):
        Walk(catalog.load("h1"), str(other))


def test_weights_of_other_networks_and_cards_without_a_prior_are_refused(tiny, tmp_path):
    path, other, robot = train(tiny), tmp_path / "other.safetensors", catalog.load("h1")
    tensors, card = checkpoint.load(path, {"kind": "walk"})
    checkpoint.save(other, tensors, {field: value for field, value in card.items() if field != "prior"})
    with pytest.raises(DamagedWeights, match="does not name its prior"):
        Walk(robot, str(other))
    checkpoint.save(other, tensors | {"log_deviation": torch.zeros(5)}, card)
    with pytest.raises(WrongWeights, match=r"'log_deviation' is \(5,\), not \(6,\)"):
        Walk(robot, str(other))


def test_in_training_the_arms_are_held_by_the_live_robots_law():
    """Arms that shall rest are where they shall be; bare motors let them hang."""
    robot = catalog.load("h1")
    env = WalkEnv(robot, reaches.clips(robot.spec, 2, np.random.default_rng(0)), None, count=4, seed=0, threads=1)
    env.start(Stage("still", 1e6, stand=1.0, push=0.0, arms=False))
    for _ in range(40):
        env.step(np.zeros((4, 12)))
    arms = robot.spec.group("waist", "arms")
    assert np.abs(env.fleet.state().q[:, arms] - robot.spec.home[arms]).mean() < 0.006


def test_an_update_moves_the_policy_by_about_the_wanted_divergence(tmp_path):
    torch.manual_seed(3)
    trainer = Trainer(WalkConfig(run=tmp_path, count=32, threads=1, ppo=PPOConfig(horizon=12)))
    before = [p.clone() for p in trainer.actor.parameters()]
    row = trainer.iterate()
    assert any((a != b).any() for a, b in zip(before, trainer.actor.parameters(), strict=True))
    assert 0 < row["kl"] < 0.2
    assert np.isfinite(row["value_loss"])


@pytest.fixture(scope="module")
def with_prior(tmp_path_factory, tiny) -> WalkConfig:
    """A run on recorded motions and a motion prior (untrained), begun with the networks of the tiny one."""
    folder = tmp_path_factory.mktemp("pmp")
    spec = catalog.load("h1").spec
    motions = reaches.clips(spec, 3, np.random.default_rng(5), seconds=4.0)
    walked = [replace(clip, category=category) for clip, category in zip(motions.clips, ("gesture", "run", "walk"), strict=True)]
    replace(motions, clips=tuple(walked)).save(folder / "clips.npz")
    joints = list(spec.motor_names[spec.group("waist", "arms")])
    model = PriorModel(spec)
    card = {"kind": "prior", "name": "p", "robot": "h1", "joints": joints, "window": 50, "shape": asdict(model.shape)}
    checkpoint.save(folder / "p.safetensors", model.state_dict(), card)
    train(tiny)
    return replace(
        tiny, run=folder / "run", begin=tiny.run, motions=(folder / "clips.npz",), reaches=2, prior=str(folder / "p.safetensors"), steps=256
    )  # fmt: skip


def test_beginning_with_another_run_keeps_what_it_knew_and_gives_the_latent_to_the_networks(with_prior, tiny):
    trainer, before = Trainer(with_prior), Trainer(tiny)
    before.resume()
    trainer.resume()
    assert trainer.ppo.lr == before.ppo.lr != tiny.ppo.lr
    assert len(trainer.env.playback.alpha) == 4, "three motions without the run, and two clips of reaches"
    trainer.env.playback.alpha[:] = 1
    trainer.env.start(STAGES[-1])
    for _ in range(20):
        seen, *_ = trainer.env.step(np.zeros((16, 12)))
    assert seen[:, -64:].std(0).min() > 0, "the latent follows the arms"
    blind = seen.copy()
    blind[:, -64:] = 0
    with torch.no_grad():
        now, then = trainer.actor(torch.tensor(seen)), before.actor(torch.tensor(blind))
        np.testing.assert_allclose(now, then, atol=1e-5)
        assert trainer.actor.normaliser.variance.min() > 0


def test_a_policy_trained_with_a_prior_walks_with_it(with_prior):
    path = train(with_prior)
    robot = catalog.load("h1")
    walk = Walk(robot, str(path))
    fleet = Fleet(robot, 1)
    home = robot.spec.home[robot.spec.group("waist", "arms")][None]
    for i in range(3):
        walk.act(fleet.state(), np.zeros((1, 3)), np.array([[0.99, 0, 0]]), home + 0.1 * i)
    assert np.abs(walk.latent).max() > 0
    assert (walk.observation[:, -64:] == walk.latent).all()


def test_other_motions_than_a_run_began_with_are_refused(with_prior):
    train(with_prior)
    with pytest.raises(OtherMotions, match="was trained with 4 motions, not 5"):
        Trainer(replace(with_prior, reaches=3)).resume()


def test_another_prior_than_a_run_began_with_is_refused(with_prior):
    train(with_prior)
    with pytest.raises(OtherTraining, match="run was begun with another prior; give the same again, or another --run"):
        Trainer(replace(with_prior, prior=None)).resume()


def test_a_run_that_is_not_there_cannot_be_begun_with(tiny, tmp_path):
    with pytest.raises(NothingToBeginWith, match="teleop-train walk --run"):
        Trainer(replace(tiny, run=tmp_path, begin=tmp_path / "none")).resume()


def test_without_the_curriculum_every_motion_plays_in_full_from_the_start(tiny, tmp_path):
    assert (Trainer(replace(tiny, run=tmp_path, curriculum=False)).env.playback.alpha == 1).all()


def test_two_processes_learn_one_policy(tiny, tmp_path):
    config = ["--run", str(tmp_path), "--count", "8", "--steps", "256", "--threads", "1", "--torch-threads", "1", "--ppo.horizon", "8"]
    trainer = str(Path(sys.executable).with_name("teleop-train"))
    command = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2", "--", trainer, "walk"]
    subprocess.run([*command, *config], check=True, timeout=120, capture_output=True)
    rows = list(csv.DictReader((tmp_path / "curves.csv").read_text().splitlines()))
    assert [int(r["steps"]) for r in rows] == [128, 256], "both processes' steps count"
    assert Walk(catalog.load("h1"), str(tmp_path / "walk.safetensors")).card["steps"] == 256


def test_legs_change_between_ticks_and_see_the_same_past(with_prior, tiny):
    robot = catalog.load("h1")
    one, other = train(tiny), train(with_prior)
    both, alone = Walk(robot, str(one), others=[str(other)]), Walk(robot, str(other))
    state, twist, posture = Fleet(robot, 1).state(), np.zeros((1, 3)), np.array([[0.99, 0, 0]])
    home = robot.spec.home[robot.spec.group("waist", "arms")][None]
    for i in range(60):
        both.act(state, twist, posture, home + 0.01 * i)
        alone.act(state, twist, posture, home + 0.01 * i)
    both.choose(1)
    for walk in (both, alone):
        walk.act(state, twist, posture, home)
    assert (both.latent == alone.latent).all(), "the other's prior has followed the arms all along"
    np.testing.assert_allclose(both.action, alone.action, atol=0.01)  # only the past actions differ
    assert both.card["prior"] == with_prior.prior
    both.choose(7)
    assert both.chosen == 1, "what is not there is not chosen"
