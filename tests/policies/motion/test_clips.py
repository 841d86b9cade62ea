"""Clips on disk, folders of motion, and synthetic ones."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from policies.motion.clip import Clip, ClipSet, Split, UnusableClips
from policies.motion.errors import UnknownClip, UnreadableMotion
from policies.motion.find import find
from policies.motion.folder import NoMotion, RetargetConfig, retarget
from policies.motion.labels import guess
from policies.motion.person import Person
from policies.motion.retarget import Retargeted, Retargeter
from policies.motion.synthetic import Generator, SyntheticConfig, synthesize
from robots.catalog import load

ROBOT = load("h1")
SPEC = ROBOT.spec
GROUP = SPEC.group("waist", "arms")


def clip(name: str = "one", frames: int = 70, split: Split = "train", seed: int = 0) -> Clip:
    rng = np.random.default_rng(seed)
    q = rng.uniform(SPEC.lower[GROUP], SPEC.upper[GROUP], (frames, 15)).astype(np.float32)
    twist, height = rng.normal(size=(frames, 3)).astype(np.float32), np.ones(frames, np.float32)
    return Clip(name, 50.0, q, twist, height, "someone", split, "walk")


def test_clips_come_back_as_they_were_saved(tmp_path: Path) -> None:
    kept = ClipSet.of(SPEC, [clip("one"), clip("zwei", 130, "val", 1)], "about")
    kept.save(tmp_path / "clips.npz")
    found = ClipSet.load(tmp_path / "clips.npz", SPEC)
    assert found.about == "about"
    assert [c.name for c in found.clips] == ["one", "zwei"]
    for a, b in zip(found.clips, kept.clips, strict=True):
        np.testing.assert_array_equal(a.q, b.q)
        np.testing.assert_array_equal(a.twist, b.twist)
        assert (a.rate, a.subject, a.split, a.category) == (b.rate, b.subject, b.split, b.category)
    assert [c.name for c in found.split("val").clips] == ["zwei"]
    assert found.seconds == pytest.approx(4.0)


def test_runs_and_jumps_are_left_out_whatever_their_label() -> None:
    walk, unlabelled = clip("walk"), clip("run with box")
    unlabelled.twist[:, 0] = 4.9
    kept = ClipSet.of(SPEC, [walk, replace(clip("leap"), category="jump"), unlabelled]).grounded()
    assert [c.name for c in kept.clips] == ["walk"]


def test_a_store_of_another_robot_or_a_damaged_one_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "clips.npz"
    replace(ClipSet.of(SPEC, [clip()]), robot="gr7").save(path)
    with pytest.raises(UnusableClips, match="gr7"):
        ClipSet.load(path, SPEC)
    for damaged in (b"", b"nonsense", path.read_bytes()[:500]):
        path.write_bytes(damaged)
        with pytest.raises(UnusableClips, match=r"clips\.npz"):
            ClipSet.load(path, SPEC)
    for head in ("[]", "{}", json.dumps({"robot": "h1", "joints": None, "format": 1, "about": ""})):
        ClipSet.of(SPEC, [clip()]).save(path)
        with np.load(path) as stored:
            np.savez(path, **dict(stored) | {"head": np.array(head)})
        with pytest.raises(UnusableClips, match=r"clips\.npz cannot be used"):
            ClipSet.load(path, SPEC)
    with pytest.raises(UnusableClips, match="teleop-train retarget"):
        ClipSet.load(tmp_path / "none.npz", SPEC)


def test_the_mirrored_twin_swaps_arms_and_turns_the_way_around() -> None:
    one = clip()
    twin = one.mirrored(SPEC)
    sign = [1, -1, -1, 1, -1, 1, -1]
    np.testing.assert_allclose(twin.q[:, 0], -one.q[:, 0])
    np.testing.assert_allclose(twin.q[:, 1:8], one.q[:, 8:15] * sign)
    np.testing.assert_allclose(twin.twist, one.twist * [1, -1, -1])
    np.testing.assert_allclose(twin.mirrored(SPEC).q, one.q)


def test_a_folder_is_retargeted_and_what_is_unusable_is_named(
    tmp_path: Path, write: Callable[..., Path], hanging: Callable[..., Path], capsys: pytest.CaptureFixture
) -> None:
    folder = tmp_path / "motion"
    (folder / "more").mkdir(parents=True)
    bend = 60 + 30 * np.sin(np.linspace(0, 9, 150))
    hanging(folder / "07_01.bvh", bend)
    hanging(folder / "more" / "ann_walk.bvh.gz", bend)
    hanging(folder / "brief.bvh", bend[:40])
    write(folder / "tentacles.bvh", {}, rename="x")
    (folder / "cut.bvh.gz").write_bytes((folder / "more" / "ann_walk.bvh.gz").read_bytes()[:900])
    (folder / "index.csv").write_text(
        "\ufeffclip_id, subject,category ,split, file\nfirst, ann,walk,val, more/ann_walk.bvh.gz\ngone,ann,walk,val,gone.bvh\nhalf,ann\n"
    )
    kept = retarget(RetargetConfig(folder, tmp_path / "out.npz"))
    said = capsys.readouterr().out
    labels = {(c.name, c.subject, c.split) for c in kept.clips}
    assert labels == {("07_01", "cmu07", guess(Path("07_01.bvh")).split), ("first", "ann", "val")}
    reasons = {"brief.bvh": "0.67 s", "tentacles.bvh": "no joint found", "cut.bvh.gz": "not a readable", "gone.bvh": "no such file"}
    for name, reason in reasons.items():
        assert f"skipped {name}" in said
        assert reason in said.split(name)[1]
    found = ClipSet.load(tmp_path / "out.npz", SPEC)
    elbow = np.pi / 2 - np.radians(np.interp(np.arange(len(found.clips[0].q)) / 50, np.arange(150) / 60, bend))
    np.testing.assert_allclose(found.clips[0].q[5:-5, 4], elbow[5:-5], atol=0.02)
    np.testing.assert_array_equal(found.clips[0].q, found.clips[1].q)


def test_a_folder_without_motion_says_so(tmp_path: Path) -> None:
    with pytest.raises(NoMotion, match="no motion in it"):
        retarget(RetargetConfig(tmp_path, tmp_path / "out.npz"))
    with pytest.raises(NoMotion, match="not a folder"):
        retarget(RetargetConfig(tmp_path / "nowhere", tmp_path / "out.npz"))
    assert not (tmp_path / "out.npz").exists()


def test_a_split_by_name_keeps_a_subject_together() -> None:
    assert guess(Path("13_07.bvh")).split == guess(Path("cmu_13_22.bvh.gz")).split
    assert guess(Path("cmu_13_22.bvh.gz")).subject == "cmu13"
    splits = [guess(Path(f"{n}_01.bvh")).split for n in range(100)]
    assert 8 <= splits.count("val") <= 32


def test_synthetic_hands_move_like_peoples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("policies.motion.synthetic.CLIP_SECONDS", 8.0)
    generator = Generator(ROBOT)
    made = generator.clip(0, 11)
    assert made.seconds == 8.0
    assert (made.q >= SPEC.lower[GROUP] - 1e-6).all()
    assert (made.q <= SPEC.upper[GROUP] + 1e-6).all()
    assert (np.abs(np.diff(made.q, axis=0)) * 50 < 1.3 * SPEC.velocity[GROUP]).all()
    middle, fast = np.percentile(generator.wrist_speeds(made), [50, 90])
    assert 0.1 < middle < 0.7  # one short clip; twenty minutes come within 15 % of people's 0.32 and 1.27 m/s
    assert 0.6 < fast < 2.2


def test_synthetic_clips_are_written_with_a_split(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("policies.motion.synthetic.CLIP_SECONDS", 0.5)
    made = synthesize(SyntheticConfig(out=tmp_path / "s.npz", minutes=1 / 12))
    again = synthesize(SyntheticConfig(out=tmp_path / "s.npz", minutes=1 / 12))
    found = ClipSet.load(tmp_path / "s.npz", SPEC)
    assert len(found) == len(made) == 10
    assert len(found.split("val")) == 1
    assert {c.category for c in found.clips} == {"synthetic"}
    np.testing.assert_array_equal(made.clips[3].q, again.clips[3].q)
    assert np.abs(made.clips[3].q[-1] - made.clips[4].q[-1]).max() > 0.01


def test_a_retargeting_that_was_stopped_goes_on(tmp_path: Path, hanging: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> None:
    folder, out = tmp_path / "motion", tmp_path / "out.npz"
    folder.mkdir()
    for i in range(3):
        hanging(folder / f"0{i}_01.bvh", 60 + 10 * i + 30 * np.sin(np.linspace(0, 9, 80)))
    made: list[int] = []
    work = Retargeter.__call__

    def stopping(self: Retargeter, person: Person) -> Retargeted:
        if len(made) == 2:
            raise KeyboardInterrupt
        made.append(person.frames)
        return work(self, person)

    monkeypatch.setattr(Retargeter, "__call__", stopping)
    with pytest.raises(KeyboardInterrupt):
        retarget(RetargetConfig(folder, out))
    assert not out.exists()
    made.clear()
    resumed = retarget(RetargetConfig(folder, out))
    assert len(made) == 1
    monkeypatch.undo()
    whole = retarget(RetargetConfig(folder, tmp_path / "whole.npz"))
    for one, other in zip(resumed.clips, whole.clips, strict=True):
        np.testing.assert_array_equal(one.q, other.q)
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


def test_a_motion_is_found_by_name_as_its_twin_or_as_a_file(tmp_path: Path, hanging: Callable[..., Path]) -> None:
    store, file = tmp_path / "clips.npz", tmp_path / "07_01.bvh"
    ClipSet.of(SPEC, [clip("one")]).save(store)
    bend = 60 + 30 * np.sin(np.linspace(0, 9, 90))
    hanging(file, bend)
    np.testing.assert_array_equal(find("one", store, ROBOT).q, clip("one").q)
    np.testing.assert_array_equal(find("one~mirror", store, ROBOT).q, clip("one").mirrored(SPEC).q)
    elbow = np.pi / 2 - np.radians(np.interp(np.arange(75) / 50, np.arange(90) / 60, bend))
    np.testing.assert_allclose(find(str(file), tmp_path / "none.npz", ROBOT).q[5:70, 4], elbow[5:70], atol=0.02)
    with pytest.raises(UnknownClip, match=r"no clip named 'on' .* known clips: one"):
        find("on", store, ROBOT)
    with pytest.raises(UnreadableMotion, match=r"brief\.bvh: only"):
        find(str(hanging(tmp_path / "brief.bvh", bend[:20])), store, ROBOT)
