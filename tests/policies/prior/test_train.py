"""A tiny prior is trained for a moment: it forecasts, its z matters, it resumes, its weights are checked."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from policies.bench.prior import PriorBench, run
from policies.errors import WrongWeights
from policies.motion.clip import Clip, ClipSet
from policies.prior.errors import NoClips
from policies.prior.evaluate import judge
from policies.prior.model import Shape
from policies.prior.prior import Prior
from policies.prior.train import PriorConfig, Trainer, train
from policies.prior.windows import Windows
from robots.catalog import load

SPEC = load("h1").spec
GROUP = SPEC.group("waist", "arms")
HOME = SPEC.home[GROUP]


def store(path: Path) -> Path:
    """Both arms swing in opposite phase, at a pace and amplitude of the clip's own: the past tells the future."""
    rng, made = np.random.default_rng(0), []
    for i in range(24):
        time = np.arange(200)[:, None] / 50
        swing = rng.uniform(0.2, 0.6) * np.sin(2 * np.pi * rng.uniform(0.6, 1.2) * time + rng.uniform(0, 6))
        q = HOME + swing * np.array([0.2, 1, 0.3, 0.2, 0.5, 0, 0, 0, -1, 0.3, 0.2, -0.5, 0, 0, 0])
        made.append(Clip(f"swing{i}", 50.0, q, np.zeros((200, 3)), np.ones(200), "s", "val" if i % 4 == 0 else "train", "walk"))
    ClipSet.of(SPEC, made).save(path)
    return path


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> tuple[PriorConfig, Path]:
    folder = tmp_path_factory.mktemp("prior")
    config = PriorConfig(
        clips=store(folder / "clips.npz"), run=folder / "run", steps=250, batch=64, judge_every=125, learning_rate=3e-3, shape=Shape(8, 8)
    )
    return config, train(config)


def test_it_forecasts_and_its_latent_is_what_tells(trained: tuple[PriorConfig, Path]) -> None:
    config, path = trained
    prior = Prior.load(str(path), SPEC)
    windows = Windows(ClipSet.load(config.clips or Path(), SPEC).split("val"), HOME)
    errors = {key: error.rms for key, error in judge(prior.model, windows, stride=7).items()}
    for seconds in (0.2, 0.5):
        assert errors["R", seconds] < 0.7 * errors["hold", seconds]
        assert errors["R past hidden", seconds] < 0.8 * errors["hold", seconds]
    assert errors["R shuffled", 0.5] > 1.5 * errors["R", 0.5]
    assert errors["E shuffled", 0.5] > 1.5 * errors["E", 0.5]
    card = json.loads(path.with_suffix(".json").read_text())
    assert card["validation_rms_rad"]["hold 0.5 s"] > card["validation_rms_rad"]["R 0.5 s"]
    curve = (config.run / "curve.csv").read_text().splitlines()
    assert [row.split(",")[0] for row in curve] == ["step", "125", "250"]


def test_the_bench_tells_the_same_and_draws_it(trained: tuple[PriorConfig, Path], tmp_path: Path) -> None:
    config, path = trained
    assert config.clips
    files = {"json": tmp_path / "p.json", "picture": tmp_path / "p.png", "curve": config.run / "curve.csv"}
    record = run(PriorBench(config.clips, str(path), stride=7, **files))
    assert json.loads(files["json"].read_text()) == record
    assert files["picture"].stat().st_size > 10_000
    rms, square = (record["error"][measure] for measure in ("root mean square, rad", "mean square, rad^2"))
    windows = Windows(ClipSet.load(config.clips, SPEC).split("val"), HOME)
    assert rms["R 0.5 s"] == judge(Prior.load(str(path), SPEC).model, windows, stride=7)["R", 0.5].rms
    assert square["hold 1.0 s"] == pytest.approx(rms["hold 1.0 s"] ** 2)
    assert record["latent"]["least deviation of a number"] > 0
    assert 1 < record["latent"]["directions in use"] < 64


def test_it_resumes_where_it_was(trained: tuple[PriorConfig, Path]) -> None:
    config, _ = trained
    trainer = Trainer(replace(config, steps=252))
    trainer.resume()
    assert trainer.step == 250
    before = {name: tensor.clone() for name, tensor in trainer.model.state_dict().items()}
    trainer.iterate()
    after = trainer.model.state_dict()
    assert torch.equal(before["past.basis"], after["past.basis"])  # the normalisation is taken once
    assert not torch.equal(before["r.evens.0.weight"], after["r.evens.0.weight"])


def test_weights_of_another_robot_or_kind_are_refused(trained: tuple[PriorConfig, Path], tmp_path: Path) -> None:
    _, path = trained
    (tmp_path / "w.safetensors").write_bytes(path.read_bytes())
    for field, value in (("robot", "gr7"), ("kind", "walk"), ("joints", ["elbow"])):
        card = json.loads(path.with_suffix(".json").read_text()) | {field: value}
        (tmp_path / "w.json").write_text(json.dumps(card))
        with pytest.raises(WrongWeights, match=field):
            Prior.load(str(tmp_path / "w.safetensors"), SPEC)


def test_without_any_clips_it_says_what_to_give() -> None:
    with pytest.raises(NoClips, match="teleop-train retarget"):
        Trainer(PriorConfig())
