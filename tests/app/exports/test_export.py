"""What is exported is what was recorded, in the layout that each format documents."""

from __future__ import annotations

import csv
import hashlib
import importlib.util
import json
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

import mujoco
import numpy as np
import pytest

from app.exports import export as exports
from app.exports import painter
from app.exports.demonstration import Choice, Demonstrations
from app.exports.errors import ExportError, MissingPackage, NotWhatWasRecorded
from app.exports.export import Exported, Look
from policies.recording.reader import Recording

h5py = pytest.importorskip("h5py")
pq = pytest.importorskip("pyarrow.parquet")
av = pytest.importorskip("av")

NO_PICTURES = Look(cameras=(), size=(32, 24))
PICTURES = Look(cameras=("head", "chase"), size=(32, 24))


def run(session: Path, format: str, output: Path, look: Look = NO_PICTURES, choice: Choice = Choice(), fps: int | None = None) -> Exported:  # noqa: B008
    written = exports.load(format)
    all = Demonstrations([session], choice, fps or written.fps)
    return exports.export(written, all, output, exports.check(written, look), lambda rows: None)


def digest(folder: Path) -> dict[str, str]:
    return {str(file.relative_to(folder)): hashlib.sha256(file.read_bytes()).hexdigest() for file in folder.rglob("*") if file.is_file()}


def lines(path: Path) -> list[dict]:
    return [json.loads(line) for line in path.read_text().splitlines()]


@pytest.fixture
def needs_a_renderer() -> None:
    try:
        painter.backend()
    except ExportError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize("format", ["lerobot", "gr00t", "robomimic", "csv"])
def test_every_recorded_row_is_there_and_nothing_is_left_aside(session: Path, tmp_path: Path, format: str) -> None:
    done = run(session, format, tmp_path / "out")
    assert (done.episodes, done.rows, done.missing) == (3, 60, 2)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("format", ["robomimic", "viser", "csv"])
def test_every_row_is_told_once_as_it_is_written(session: Path, tmp_path: Path, format: str) -> None:
    written, told = exports.load(format), []
    all = Demonstrations([session], Choice(), written.fps)
    done = exports.export(written, all, tmp_path / "out", exports.check(written, NO_PICTURES), told.append)
    assert sum(told) == done.rows == all.rows


@pytest.mark.parametrize("format", ["lerobot", "gr00t", "robomimic", "csv"])
def test_the_same_recording_gives_the_same_bytes(session: Path, tmp_path: Path, format: str) -> None:
    for name in ("one", "two"):
        run(session, format, tmp_path / name)
    assert digest(tmp_path / "one") == digest(tmp_path / "two")


@pytest.mark.usefixtures("needs_a_renderer")
def test_pictures_are_drawn_from_the_log_and_come_out_the_same_twice(session: Path, tmp_path: Path) -> None:
    for name in ("one", "two"):
        done = run(session, "lerobot", tmp_path / name, PICTURES, Choice(ids=("2",)), fps=25)
        assert (done.rows, done.pictures) == (8, 16)
    assert digest(tmp_path / "one") == digest(tmp_path / "two")
    films = sorted(tmp_path.glob("one/videos/*/chunk-000/file-000.mp4"))
    assert [film.parent.parent.name for film in films] == ["observation.images.chase", "observation.images.head"]
    with av.open(str(films[0])) as film:
        pictures = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert np.shape(pictures) == (8, 24, 32, 3)
    assert np.std(pictures[0]) > 10  # sky, floor and robot


@pytest.mark.usefixtures("needs_a_renderer")
def test_gr00t_and_robomimic_hold_the_same_pictures(session: Path, tmp_path: Path) -> None:
    look, choice = Look(cameras=("wrist_left",), size=(32, 24)), Choice(ids=("2",))
    for format in ("gr00t", "robomimic"):
        assert run(session, format, tmp_path / format, look, choice, fps=10).pictures == 4
    film = tmp_path / "gr00t/videos/chunk-000/observation.images.wrist_left/episode_000000.mp4"
    with av.open(str(film)) as container:
        seen = np.array([frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)], float)
    with h5py.File(tmp_path / "robomimic/demonstrations.hdf5") as file:
        demo = file["data/demo_0"]
        kept, then = demo["obs/wrist_left_image"][:], demo["next_obs/wrist_left_image"][:]
    assert kept.dtype == np.uint8
    np.testing.assert_array_equal(then, np.concatenate([kept[1:], kept[-1:]]))
    assert np.abs(seen - kept).mean() < 10  # compressed
    modality = json.loads((tmp_path / "gr00t/meta/modality.json").read_text())
    assert modality["video"] == {"wrist_left": {"original_key": "observation.images.wrist_left"}}


def test_lerobot_v3_has_the_documented_schema(session: Path, tmp_path: Path) -> None:
    run(session, "lerobot", tmp_path / "out")
    info = json.loads((tmp_path / "out/meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"], info["robot_type"]) == ("v3.0", 50, "h1")
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"], info["splits"]) == (3, 60, 2, {"train": "0:3"})
    episodes = pq.read_table(tmp_path / "out/meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [(e["episode_index"], e["length"], e["tasks"]) for e in episodes] == [
        (0, 24, ["pick up the cup"]),
        (1, 16, ["wave"]),
        (2, 20, ["pick up the cup"]),
    ]
    assert [(e["dataset_from_index"], e["dataset_to_index"]) for e in episodes] == [(0, 24), (24, 40), (40, 60)]
    rows = [
        row
        for episode in episodes
        for row in pq.read_table(
            tmp_path / "out" / info["data_path"].format(chunk_index=episode["data/chunk_index"], file_index=episode["data/file_index"])
        ).to_pylist()
    ]
    assert [row["index"] for row in rows] == list(range(60))
    assert rows[0].keys() == info["features"].keys()
    for name, feature in info["features"].items():
        width = feature["shape"][0]
        assert width == 1 or {len(row[name]) for row in rows} == {width}
        assert feature["names"] is None or len(feature["names"]) == width
    assert [row["timestamp"] for row in rows[24:40]] == pytest.approx(np.arange(16) / 50)
    assert [row["frame_index"] for row in rows if row["next.done"]] == [23, 15, 19]
    assert sum(row["next.reward"] for row in rows) == 1.0  # one success
    tasks = pq.read_table(tmp_path / "out/meta/tasks.parquet")
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == ["task"]
    assert tasks.to_pylist() == [{"task_index": 0, "task": "pick up the cup"}, {"task_index": 1, "task": "wave"}]


def test_lerobot_statistics_are_those_of_all_rows(session: Path, tmp_path: Path) -> None:
    run(session, "lerobot", tmp_path / "out")
    actions = np.concatenate([pq.read_table(f)["action"].to_pylist() for f in sorted((tmp_path / "out/data").rglob("*.parquet"))])
    told = json.loads((tmp_path / "out/meta/stats.json").read_text())["action"]
    for name, values in {"min": actions.min(0), "max": actions.max(0), "mean": actions.mean(0), "std": actions.std(0)}.items():
        np.testing.assert_allclose(told[name], values, atol=1e-6)
    assert told["count"] == [60]


def test_gr00t_modality_names_every_number_once(session: Path, tmp_path: Path) -> None:
    run(session, "gr00t", tmp_path / "out")
    meta = tmp_path / "out/meta"
    info, modality = (json.loads((meta / name).read_text()) for name in ("info.json", "modality.json"))
    assert set(modality) == {"state", "action", "video", "annotation"}
    for kind, column in (("state", "observation.state"), ("action", "action")):
        covered = [i for part in modality[kind].values() for i in range(part["start"], part["end"])]
        whole = list(range(info["features"][column]["shape"][0]))
        assert sorted(covered) == (whole if kind == "state" else sorted(set(whole) - {41}))  # 41 is the enable, no action
    names = info["features"]["observation.state"]["names"]
    part = modality["state"]["right_arm"]
    assert all(name.startswith("right_") for name in names[part["start"] : part["end"]])
    assert part["end"] - part["start"] == 7
    columns = set(pq.read_schema(tmp_path / "out" / info["data_path"].format(episode_chunk=0, episode_index=2)).names)
    assert {f"annotation.{name}" for name in modality["annotation"]} == {name for name in columns if name.startswith("annotation")}
    assert columns == {name for name, feature in info["features"].items() if feature["dtype"] != "video"}
    assert lines(meta / "episodes.jsonl")[1] == {"episode_index": 1, "tasks": ["wave"], "length": 16}
    tasks = {task["task_index"]: task["task"] for task in lines(meta / "tasks.jsonl")}
    failed = pq.read_table(tmp_path / "out" / info["data_path"].format(episode_chunk=0, episode_index=1)).to_pylist()[0]
    assert tasks[failed["annotation.human.action.task_description"]] == "wave"
    assert tasks[failed["annotation.human.validity"]] == "invalid"


def test_robomimic_has_the_documented_layout(session: Path, tmp_path: Path) -> None:
    run(session, "robomimic", tmp_path / "out")
    with h5py.File(tmp_path / "out/demonstrations.hdf5") as file:
        data = file["data"]
        assert data.attrs["total"] == 60
        assert set(json.loads(data.attrs["env_args"])) == {"env_name", "env_type", "env_kwargs"}
        assert list(data) == ["demo_0", "demo_1", "demo_2"]
        for demo in data.values():
            count = demo.attrs["num_samples"]
            assert {len(demo[name]) for name in ("states", "actions", "rewards", "dones")} == {count}
            assert demo["rewards"].shape == demo["dones"].shape == (count,)
            assert np.abs(demo["actions"][:]).max() <= 1
            assert set(demo["obs"]) == set(demo["next_obs"])
            assert (demo["next_obs/position"][:-1] == demo["obs/position"][1:]).all()
        assert list(file["mask/success"]) == [b"demo_0"]
        assert list(file["mask/failure"]) == [b"demo_1"]


def test_csv_keeps_every_digit(session: Path, tmp_path: Path) -> None:
    run(session, "csv", tmp_path / "out", choice=Choice(ids=("lab_002",)))
    with (tmp_path / "out/episode_000000_lab_002.csv").open() as file:
        rows = list(csv.DictReader(file))
    with Recording(session) as recording:
        recorded = recording.episode(recording.infos[1]).rows
    assert [float(row["target.left_knee_joint"]) for row in rows] == recorded["ctrl"][:, 3].tolist()
    assert [int(row["tick"]) for row in rows] == recorded["tick"].tolist()


def test_a_viser_page_holds_its_recording_and_needs_no_network(session: Path, tmp_path: Path) -> None:
    done = run(session, "viser", tmp_path / "out", choice=Choice(ids=("2",)))
    page, recording = (tmp_path / "out" / f"lab_002.{ending}" for ending in ("html", "viser"))
    assert (done.rows, sorted((tmp_path / "out").iterdir())) == (8, [page, recording])
    assert "__VISER_EMBED_DATA__" in page.read_text()


@pytest.mark.parametrize(
    ("choice", "ids"),
    [
        (Choice(labels=("wave",)), ["lab_002"]),
        (Choice(ids=("1", "lab_003")), ["lab_001", "lab_003"]),
        (Choice(success=True), ["lab_001"]),
        (Choice(success=False), ["lab_002"]),
    ],
)
def test_episodes_are_chosen(session: Path, choice: Choice, ids: list[str]) -> None:
    assert [info.id for info in Demonstrations([session], choice).infos] == ids


def test_a_choice_that_fits_nothing_lists_what_is_there(session: Path) -> None:
    with pytest.raises(ExportError, match="no finished episode fits; those with rows are: lab_001 'pick up the cup'; lab_002 'wave'"):
        Demonstrations([session], Choice(labels=("dance",)))


def test_rows_are_thinned_evenly_or_not_at_all(session: Path) -> None:
    thin = Demonstrations([session], Choice(ids=("2",)), fps=10)
    assert [d.signals["tick"].tolist() for d in thin] == [[124, 129, 134, 139]]
    with pytest.raises(ExportError, match="--fps can be 50, 25, 10, 5, 2, 1"):
        Demonstrations([session], Choice(), fps=30)


@pytest.mark.parametrize("drawn", [24, 23])
def test_pictures_are_counted_however_dark_they_are(session: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, drawn: int) -> None:
    class Night:
        def frames(self, qpos: np.ndarray) -> Iterator[np.ndarray]:
            yield from np.zeros((min(len(qpos), drawn), 1, 24, 32, 3), np.uint8)

    monkeypatch.setattr(exports, "Painter", lambda *_: nullcontext(Night()))
    look = Look(cameras=("head",), size=(32, 24))
    if drawn == 24:
        assert run(session, "robomimic", tmp_path / "out", look).pictures == 60
    else:
        with pytest.raises(NotWhatWasRecorded, match=r"pictures .* are \[23\] instead of 24 a camera"):
            run(session, "robomimic", tmp_path / "out", look)


def test_what_is_not_the_recording_is_not_kept(session: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robomimic = exports.load("robomimic")
    add = robomimic.add

    def wrong_once(self, demonstration, frames) -> None:
        tampered = {**demonstration.signals, "velocity": demonstration.signals["velocity"].copy()}
        tampered["velocity"][5, 7] = np.nextafter(tampered["velocity"][5, 7], np.inf)
        add(self, type(demonstration)(demonstration.index, demonstration.info, demonstration.metadata, tampered), frames)

    monkeypatch.setattr(robomimic, "add", wrong_once)
    with pytest.raises(NotWhatWasRecorded, match=r"velocity .* differs in 1 of 24 rows, first in row 5"):
        run(session, "robomimic", tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_an_existing_folder_is_left_alone(session: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    with pytest.raises(ExportError, match="exists already"):
        run(session, "csv", tmp_path / "out")


def test_a_missing_package_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *rest: None if name == "av" else find_spec(name, *rest))
    with pytest.raises(MissingPackage, match=r"needs the package av; install it from the checkout with: pip install -e '\.\[export\]'"):
        exports.load("gr00t")


@pytest.mark.parametrize(
    ("look", "sentence"),
    [
        (Look(("nose",)), "no camera nose; known cameras: head, "),
        (Look(size=(33, 24)), "both sides are even"),
        (Look(size=(2, 2)), "from 16"),
    ],
)
def test_pictures_that_cannot_be_are_refused(look: Look, sentence: str) -> None:
    with pytest.raises(ExportError, match=sentence):
        exports.check(exports.load("lerobot"), look)


def test_no_renderer_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(painter, "_draws", lambda backend: False)
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    with pytest.raises(ExportError, match=r"tried MUJOCO_GL=osmesa.*apt-get install libosmesa6.*--cameras none"):
        painter.backend.__wrapped__()


def test_a_camera_that_the_robot_lacks_is_named(session: Path, tmp_path: Path) -> None:
    all = Demonstrations([session], Choice(ids=("2",)))
    eyeless = mujoco.MjModel.from_xml_string("<mujoco><worldbody><body name='pelvis'/></worldbody></mujoco>")
    all.model = eyeless
    with pytest.raises(ExportError, match=r"the recorded h1 has no camera head; choose others with --cameras"):
        exports.export(exports.load("lerobot"), all, tmp_path / "out", Look(("head", "chase"), (32, 24)), lambda rows: None)
