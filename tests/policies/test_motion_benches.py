"""The benches on recorded motions: measures by hand where they can be, and what must come out when nothing disturbs."""

import json
from pathlib import Path

import numpy as np
import pytest

from policies.bench import falls, paper, push, robustness, wrists
from policies.bench.key_points import KeyPoints
from policies.bench.motions import motions
from policies.bench.tracking import MEASURES, Conditions, track
from policies.motion.clip import Clip, ClipSet, UnusableClips
from robots import catalog

ROBOT = catalog.load("h1")
SPEC = ROBOT.spec
HOME = SPEC.home[SPEC.group("waist", "arms")]


def clip(name: str, seconds: float, swing: float, vx: float = 0.0, split="val", category="gesture") -> Clip:
    time = np.arange(round(seconds * 50)) / 50
    q = HOME + swing * np.sin(2 * np.pi * 0.5 * time)[:, None] * np.eye(15)[4]
    twist = np.tile([vx, 0, 0], (len(time), 1))
    return Clip(name, 50.0, q, twist, np.full(len(time), 1.0), "somebody", split, category)


def drawn(picture: Path) -> bool:
    return picture.read_bytes()[1:4] == b"PNG"


@pytest.fixture(scope="module")
def clips(tmp_path_factory):
    path = tmp_path_factory.mktemp("clips") / "clips.npz"
    made = [
        clip("still", 3.0, 0.0),
        clip("swing", 4.0, 0.4, vx=0.4),
        clip("run", 3.0, 0.2, category="run"),
        clip("learnt", 3.0, 0.2, split="train"),
    ]
    ClipSet.of(SPEC, made).save(path)
    return path


def test_only_validation_motions_on_the_ground_are_played(clips):
    assert [c.name for c in motions(ROBOT, clips).clips] == ["still", "swing"]


def test_a_file_without_validation_clips_is_refused(tmp_path):
    ClipSet.of(SPEC, [clip("learnt", 2.0, 0.1, split="train")]).save(tmp_path / "c.npz")
    with pytest.raises(UnusableClips, match="for validation"):
        motions(ROBOT, tmp_path / "c.npz")


def test_measures_of_a_still_and_of_a_swinging_robot(clips):
    score = track(ROBOT, "walk_h1", motions(ROBOT, clips), Conditions(repeats=2))
    assert score.survived.all()
    assert set(MEASURES) <= set(score.values)
    still, swing = slice(0, 2), slice(2, 4)
    values = score.values
    assert (values["action_upper"][still] == 0).all()
    assert (values["reference_acc"][still] == 0).all()
    # a sine of 0.4 rad at 0.5 Hz in one of 15 joints: mean |speed| is 4 x amplitude x frequency
    assert values["action_upper"][swing] == pytest.approx(4 * 0.4 * 0.5 / 50 / 15, rel=0.02)
    assert values["reference_acc"][swing] == pytest.approx(0.4 * np.pi**2 * 2 / np.pi / 15, rel=0.02)
    assert values["jpe_27"] == pytest.approx(values["jpe"] * 15 / 27)
    assert values["velocity"][still].max() < 0.02
    assert values["gravity"].max() < 1.0
    assert values["kpe_pelvis"][still].max() < values["kpe"][still].max() < 0.1


def test_pushes_that_nobody_survives_are_counted_as_falls(clips):
    long = ClipSet.of(SPEC, [clip("long", 8.0, 0.0)])
    score = track(ROBOT, "walk_h1", long, Conditions(repeats=3, push=8.0))
    assert score.mean()["survival"] == 0
    assert list(score.mean(all_rollouts=False)) == ["survival"]


def test_key_points_follow_the_waist():
    points = KeyPoints(ROBOT)
    turned = HOME.copy()
    turned[0] += np.pi / 6
    before, after = points(np.stack([HOME, turned]))
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    np.testing.assert_allclose(after, before @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]), atol=1e-9)


def test_the_paper_bench_prints_both_writes_json_and_draws(clips, tmp_path, capsys):
    out, picture = tmp_path / "paper.json", tmp_path / "pictures" / "paper.png"
    paper.run(paper.PaperBench(motions=clips, policy=("walk_h1",), repeats=1, seeds=(0, 1), json=out, picture=picture))
    assert drawn(picture)
    record = json.loads(out.read_text())
    assert record["rows"][0]["all"]["survival"] == 1
    assert record["paper"]["PMP"]["gravity"] == 1.301
    assert "paper: PMP" in capsys.readouterr().out


def test_robustness_draws_what_it_measures(clips, tmp_path):
    picture = tmp_path / "r.png"
    record = robustness.run(robustness.RobustnessBench(clips, ("walk_h1",), push=(0.0,), speed=(2.0,), repeats=1, picture=picture))
    assert [row.get("push", row.get("speed")) for row in record["rows"]] == [0.0, 2.0]
    assert drawn(picture)


def test_a_push_of_no_force_is_recovered_from_at_once_when_standing():
    row, _ = push.push(ROBOT, "walk_h1", push.PushBench(force=0.0, pushes=2), speed=0.0)
    assert row["recovery"] == 0
    assert row["upright"] == 2


def test_the_push_bench_draws_every_push(tmp_path):
    picture = tmp_path / "push.png"
    record = push.run(push.PushBench(("walk_h1",), pushes=2, picture=picture))
    assert [row["what"] for row in record["rows"]] == ["walking", "standing"]
    assert [row["recovered"] for row in record["rows"]] == [2, 2]
    assert drawn(picture)


def test_random_driving_for_a_robot_minute(clips):
    row = falls.drive(ROBOT, "walk_h1", motions(ROBOT, clips), falls.FallsBench(hours=1 / 60, robots=4))
    assert row["falls"] <= 1
    assert 0.001 < row["kilometres"] < 0.06


def test_wrists_of_the_live_robot_follow_a_slow_swing(clips, tmp_path):
    record = wrists.run(wrists.WristsBench(motions=clips, json=tmp_path / "w.json", picture=tmp_path / "w.png"))
    assert drawn(tmp_path / "w.png")
    assert record["fell"] == 0
    assert record["operator's targets"]["mm"] < 25
    assert record["joint targets"]["mm"] < 10
    assert record["joint targets"]["degrees"] < 3
    assert json.loads((tmp_path / "w.json").read_text()) == record
