"""The learner: advantages by hand, KL by hand, and a training of seconds that learns, resumes and exports."""

import csv
from dataclasses import replace

import numpy as np
import pytest
import torch

from policies import checkpoint
from policies.errors import WrongWeights
from policies.ppo.algorithm import PPOConfig, advantages, log_prob
from policies.ppo.train import Trainer, WalkConfig, train
from policies.walk import Walk
from robots import catalog


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


def test_an_update_moves_the_policy_by_about_the_wanted_divergence(tmp_path):
    torch.manual_seed(3)
    trainer = Trainer(WalkConfig(run=tmp_path, count=32, threads=1, ppo=PPOConfig(horizon=12)))
    before = [p.clone() for p in trainer.actor.parameters()]
    row = trainer.iterate()
    assert any((a != b).any() for a, b in zip(before, trainer.actor.parameters(), strict=True))
    assert 0 < row["kl"] < 0.2
    assert np.isfinite(row["value_loss"])
