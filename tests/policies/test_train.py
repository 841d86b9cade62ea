"""`teleop-train` as a person meets it: help, one sentence for each mistake, from files of motion to a prior."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from policies.motion.clip import Clip, ClipSet
from policies.prior.prior import Prior
from policies.train import main
from robots.catalog import load

SPEC = load("h1").spec


def test_help_names_every_step_and_gives_examples(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--help"])
    assert ended.value.code == 0
    told = capsys.readouterr().out
    assert all(f"  teleop-train {step} --" in told for step in ("retarget", "synthetic", "prior", "walk", "mean", "curves"))


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["retarget", "--clips", "nowhere", "--out", "clips.npz"], r"nowhere: is not a folder; give a folder of \.bvh"),
        (["retarget", "--clips", ".", "--out", "clips.npz"], r"no motion in it could be used; give a folder of \.bvh"),
        (["synthetic", "--robot", "g2", "--out", "s.npz"], r"no robot named 'g2'; known robots: .*h1"),
        (["prior", "--clips", "gone.npz"], r"gone\.npz cannot be used: .*`teleop-train retarget"),
        (["prior"], r"no clips to learn from; give --clips FILE .* --synthetic FILE"),
    ],
)
def test_a_mistake_is_one_sentence(arguments: list[str], sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    told = str(ended.value.code)
    assert re.fullmatch(rf"teleop-train: .*{sentence}.*", told)
    assert not list(tmp_path.rglob("*.npz"))


def test_synthetic_clips_train_a_prior_that_loads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("policies.motion.synthetic.CLIP_SECONDS", 2.2)
    clips, run = tmp_path / "s.npz", tmp_path / "run"
    main(["synthetic", "--minutes", "0.4", "--out", str(clips)])
    small = ["--run", str(run), "--batch", "16", "--shape.past-curves", "4", "--shape.future-curves", "4"]
    main(["prior", "--synthetic", str(clips), "--steps", "3", *small])
    assert Prior.load(str(run / "prior_h1.safetensors"), SPEC).card["steps"] == 3
    main(["prior", "--synthetic", str(clips), "--steps", "5", *small])
    assert Prior.load(str(run / "prior_h1.safetensors"), SPEC).card["steps"] == 5
    with pytest.raises(SystemExit, match="run was begun with another seed; give the same again, or another --run"):
        main(["prior", "--synthetic", str(clips), "--steps", "7", "--seed", "2", *small])


def test_clips_that_are_too_short_for_a_prior_are_told(tmp_path: Path) -> None:
    clip = Clip("brief", 50.0, np.zeros((40, 15)), np.zeros((40, 3)), np.ones(40), "s", "train", "other")
    ClipSet.of(SPEC, [clip]).save(tmp_path / "clips.npz")
    with pytest.raises(SystemExit, match="no clip is longer than 50 frames; give --clips FILE"):
        main(["prior", "--clips", str(tmp_path / "clips.npz"), "--run", str(tmp_path / "run")])
