"""`teleop-train mean`: what becomes of the weights, and what cannot be averaged."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file

from policies import checkpoint
from policies.networks import Actor
from policies.observation import Mirror, action_mirror, layout, where
from policies.train import main
from robots.catalog import load

SPEC = load("h1").spec
CARD = {"kind": "walk", "robot": "h1", "observation": 274, "action": 12, "prior": "prior_h1", "steps": 7}


def actor() -> Actor:
    return Actor(Mirror.stack(list(layout(SPEC).values())), action_mirror(SPEC))


@pytest.fixture
def runs(tmp_path: Path) -> list[str]:
    """Two trainings that left walk.safetensors in their folders."""
    files = []
    for i, name in enumerate(("a", "b")):
        torch.manual_seed(i)
        files.append(tmp_path / name / "walk.safetensors")
        checkpoint.save(files[-1], actor().state_dict(), CARD | {"seed": i})
    return [str(file) for file in files]


def test_every_weight_is_the_mean_of_the_shares(runs, tmp_path):
    out = tmp_path / "mean" / "walk.safetensors"
    main(["mean", "--weights", *runs, "--shares", "3", "1", "--out", str(out)])
    a, b, mixed = map(load_file, (*runs, out))
    for name in a:
        torch.testing.assert_close(mixed[name], (3 * a[name] + b[name]) / 4)
    told = checkpoint.card(out)
    assert [(part["weights"], part["share"], part["seed"]) for part in told["mean_of"]] == [("a", 0.75, 0), ("b", 0.25, 1)]
    assert told["prior"] == "prior_h1"


def test_sideways_commands_are_seen_larger_and_nothing_else_is(runs, tmp_path):
    out = tmp_path / "faster.safetensors"
    main(["mean", "--weights", runs[0], runs[0], "--sideways", "1.1", "--out", str(out)])
    plain, faster = actor(), actor()
    for network, file in ((plain, runs[0]), (faster, out)):
        network.load_state_dict(load_file(file))
    seen = torch.randn(1, 274)
    sideways = where(SPEC, "twist").start + 1
    change = (faster.features(seen) / plain.features(seen)).ravel() - 1
    changed = change.abs() > 1e-6
    assert changed.tolist() == (plain.inputs.basis[:, sideways] != 0).tolist()
    assert change[changed] == pytest.approx(0.1, rel=0.02)  # 0.01 stands beside the deviation


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--weights", "{0}"], "1 weights with shares .* make no mean: give two --weights or more"),
        (["--weights", "{0}", "{1}", "--shares", "1"], "one of --shares above 0 for each"),
        (["--weights", "{0}", "{1}", "--shares", "1", "0"], "one of --shares above 0 for each"),
        (["--weights", "{0}", "{1}", "--sideways", "0"], "--sideways above 0"),
        (["--weights", "prior_h1", "{0}"], "made for kind 'prior', not 'walk'"),
        (["--weights", "{0}", "walk_h1_no_prior"], "walk_h1_no_prior.safetensors was made for prior None, not 'prior_h1'"),
        (["--weights", "{0}", "gone"], "no policy named 'gone'"),
    ],
)
def test_what_cannot_be_averaged_is_one_sentence(runs, tmp_path, arguments, sentence):
    with pytest.raises(SystemExit, match=f"teleop-train: .*{sentence}"):
        main(["mean", *(a.format(*runs) for a in arguments), "--out", str(tmp_path / "out.safetensors")])
    assert not (tmp_path / "out.safetensors").exists()
