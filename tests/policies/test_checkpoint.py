"""Weights on disk: what is listed can be loaded, whatever their training called them."""

from pathlib import Path

import numpy as np
import pytest
import torch

from policies import checkpoint
from policies.errors import DamagedWeights


def test_a_copied_training_is_known_by_its_file_and_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(checkpoint, "SHIPPED", tmp_path)
    told = {"kind": "walk", "name": "walk", "robot": "h1"}
    checkpoint.save(tmp_path / "calm_h1.safetensors", {"x": torch.ones(2)}, told)
    checkpoint.save(tmp_path / "other.safetensors", {"x": torch.ones(2)}, told | {"robot": "gr1"})
    assert checkpoint.known("walk", tmp_path, robot="h1") == ["calm_h1"]
    tensors, card = checkpoint.load_arrays(checkpoint.find("calm_h1", "walk"), {"robot": "h1"})
    assert card["kind"] == "walk"
    np.testing.assert_array_equal(tensors["x"], [1, 1])


def test_weights_without_their_card_are_named(tmp_path: Path):
    checkpoint.save(tmp_path / "calm_h1.safetensors", {"x": torch.ones(2)}, {"kind": "walk"})
    (tmp_path / "calm_h1.json").unlink()
    with pytest.raises(DamagedWeights, match=r"calm_h1\.safetensors cannot be read"):
        checkpoint.known("walk", tmp_path)


@pytest.mark.parametrize(
    ("policy", "title"),
    [("walk_h1", "walk_h1"), ("runs/pmp-11/walk.safetensors", "pmp-11"), ("elsewhere/mine.safetensors", "mine")],
)
def test_weights_of_runs_are_called_by_their_run(policy, title):
    assert checkpoint.title(policy) == title
