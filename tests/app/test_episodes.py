"""The REST interface of episodes, over a real server, and the three commands that work on files."""

import json
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import uvicorn
from fastapi import FastAPI
from small_rows import DTYPE, METADATA, MODEL, NQ, PACKED_MODEL, START, make_rows

from app import recordings
from app.episodes import Episodes, router
from app.shared import Ring
from policies.command import Command
from policies.episode import EpisodeInfo, row_dtype
from policies.recording.provenance import describe
from policies.recording.reader import Recording
from policies.recording.session_file import SessionFile
from policies.recording.writer import EpisodeWriter
from robots import catalog
from robots.plant import Plant


class Site:
    """A server with nothing but episodes."""

    def __init__(self, folder: Path) -> None:
        self.ring, self.seed = Ring(np.zeros(Ring.size(DTYPE, 256), np.uint8), DTYPE, 256), 0
        self.episodes = Episodes(folder, lambda: (METADATA, PACKED_MODEL), self.ring, lambda: self.seed)
        app = FastAPI()
        app.include_router(router(self.episodes))
        self._server = uvicorn.Server(uvicorn.Config(app, port=0, log_level="error", ws="none"))
        self._thread = threading.Thread(target=self._server.run)
        self._thread.start()
        while not self._server.started:
            time.sleep(0.01)
        self.port = self._server.servers[0].sockets[0].getsockname()[1]

    def close(self) -> None:
        self.episodes.close()
        self._server.should_exit = True
        self._thread.join()

    def push(self, count: int) -> np.ndarray:
        rows = make_rows(range(self.ring.count, self.ring.count + count))
        for row in rows:
            self.ring.push(np.array(row))
        return rows

    def ask(self, method: str, path: str, body: Any = None) -> tuple[int, bytes]:
        url = f"http://127.0.0.1:{self.port}/api/episodes{path}"
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(url, data, {"Content-Type": "application/json"}, method=method)
        try:
            with urllib.request.urlopen(request, timeout=20) as answer:
                return answer.status, answer.read()
        except urllib.error.HTTPError as error:
            with error:
                return error.code, error.read()

    def json(self, method: str, path: str, body: Any = None) -> Any:
        code, text = self.ask(method, path, body)
        assert code < 300, (code, text)
        return json.loads(text)

    def record(self, count: int, **stop: Any) -> tuple[str, np.ndarray]:
        id = self.json("POST", "")["id"]
        rows = self.push(count)
        self.json("POST", f"/{id}/stop", stop)
        return id, rows


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    site = Site(tmp_path)
    yield site
    site.close()


def test_record_list_and_stop(site: Site):
    id = site.json("POST", "", {"label": "wave"})["id"]
    site.push(10)
    (listed,) = site.json("GET", "")
    assert (listed["id"], listed["label"], listed["ended"]) == (id, "wave", "open")
    stopped = site.json("POST", f"/{id}/stop", {"label": "waved", "success": True})
    assert stopped["rows"] == 10
    assert site.json("GET", "") == [stopped]
    assert (stopped["label"], stopped["success"], stopped["ended"], stopped["gaps"]) == ("waved", True, "stopped", 0)


def test_an_episode_keeps_the_seed_of_the_reset_before_it_whoever_records(site: Site):
    for site.seed in (7, 0):
        site.record(5)
    assert [episode["seed"] for episode in site.json("GET", "")] == [0, 7]
    assert site.ask("POST", "", {"seed": 3})[0] == 422


def test_a_download_is_a_file_of_its_own(site: Site, tmp_path: Path):
    site.record(8)
    id, rows = site.record(30, label="second", success=False)
    path = tmp_path / "elsewhere"
    path.write_bytes(site.ask("GET", f"/{id}/download")[1])
    with Recording(path) as recording:
        assert recording.finished
        (episode,) = recording.episodes()
    assert (episode.info.id, episode.info.label, episode.info.success, episode.info.ended) == (id, "second", False, "stopped")
    assert episode.rows.tobytes() == rows.tobytes()
    assert (episode.metadata, episode.model) == (METADATA, MODEL)


def test_frames_are_float32_rows_at_25_hz(site: Site):
    id, rows = site.record(20)
    frames = np.frombuffer(site.ask("GET", f"/{id}/frames")[1], "<f4").reshape(-1, NQ)
    with np.errstate(over="ignore"):
        assert np.array_equal(frames, METADATA.qpos(rows)[::2].astype("<f4"), equal_nan=True)


def test_deleting_removes_the_episode_and_its_bytes(site: Site):
    kept, _ = site.record(5)
    gone, _ = site.record(200)
    (file,) = site.episodes.library.files()
    size = file.stat().st_size
    assert site.ask("DELETE", f"/{gone}")[0] == 204
    assert file.stat().st_size < size
    assert [record["id"] for record in site.json("GET", "")] == [kept]
    assert site.ask("GET", f"/{gone}/download")[0] == 404
    again, _ = site.record(3)
    assert {record["id"] for record in site.json("GET", "")} == {kept, again}


def test_deleting_while_another_is_recorded_keeps_recording(site: Site):
    gone, _ = site.record(20)
    id = site.json("POST", "")["id"]
    site.push(10)
    assert site.ask("DELETE", f"/{gone}")[0] == 204
    assert site.ask("DELETE", f"/{id}")[0] == 409
    site.push(10)
    assert site.json("POST", f"/{id}/stop", {})["rows"] == 20
    assert [record["id"] for record in site.json("GET", "")] == [id]


def test_discarding_the_open_episode(site: Site):
    id = site.json("POST", "")["id"]
    site.push(10)
    assert site.ask("POST", f"/{id}/discard")[0] == 204
    assert site.json("GET", "") == []
    assert site.ask("POST", f"/{id}/discard")[0] == 404


@pytest.mark.parametrize(
    ("method", "path", "body", "code"),
    [
        ("POST", "/nothing/stop", {}, 409),
        ("GET", "/nothing/download", None, 404),
        ("GET", "/nothing/frames", None, 404),
        ("DELETE", "/nothing", None, 404),
        ("GET", "/..%2F..%2Fetc%2Fpasswd/download", None, 404),
        ("GET", "/..%5C..%5Cpasswd/download", None, 422),
        ("DELETE", f"/{'x' * 65}", None, 422),
        ("POST", "", {"label": "x" * 201}, 422),
        ("POST", "", {"unknown": 1}, 422),
    ],
)
def test_bad_requests_change_nothing(site: Site, method: str, path: str, body: Any, code: int):
    id, _ = site.record(3)
    assert site.ask(method, path, body)[0] == code
    assert [record["id"] for record in site.json("GET", "")] == [id]


def test_two_starts_are_a_conflict(site: Site):
    id = site.json("POST", "")["id"]
    code, text = site.ask("POST", "")
    assert code == 409
    assert id in text.decode()


def test_what_a_crash_left_is_mended_when_the_server_starts(tmp_path: Path, crashed: Path):
    site = Site(tmp_path)
    try:
        deadline = time.monotonic() + 10
        while not _finished(crashed):
            assert time.monotonic() < deadline
            time.sleep(0.02)
        (record,) = site.json("GET", "")
        assert (record["ended"], record["rows"]) == ("truncated", 40)
    finally:
        site.close()


@pytest.fixture
def crashed(tmp_path: Path) -> Path:
    """A session file whose program died while it recorded 40 rows."""
    file = SessionFile(tmp_path / "crashed.mcap")
    writer = EpisodeWriter(file, METADATA, PACKED_MODEL)
    writer.begin(EpisodeInfo("crashed_001", 1, file.path, START))
    writer.rows(make_rows(range(40)))
    writer.flush()
    file.publish()
    file.close()
    return file.path


def _finished(path: Path) -> bool:
    with Recording(path) as recording:
        return recording.finished


def test_the_list_command_shows_every_episode(site: Site, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    id, _ = site.record(50, label="[red]wave[/red]", success=True)
    assert recordings.episodes(tmp_path) == 0
    (line,) = [line for line in capsys.readouterr().out.splitlines() if id in line]
    assert "[red]wave[/red]" in line
    assert "50" in line
    assert recordings.episodes(tmp_path / "nowhere") == 0
    assert "no episodes" in capsys.readouterr().out


def test_the_recover_command(tmp_path: Path, crashed: Path, capsys: pytest.CaptureFixture[str]):
    assert recordings.recover(tmp_path) == 0
    assert "recovered: 1 episodes, 40 rows, 0 ticks missing" in capsys.readouterr().out
    assert recordings.recover(crashed) == 0
    assert "is complete" in capsys.readouterr().out
    junk = tmp_path / "junk.mcap"
    junk.write_bytes(b"junk")
    assert recordings.recover(tmp_path) == 1
    assert capsys.readouterr().err.count("\n") == 1


def test_the_replay_command_says_what_is_wrong(site: Site, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    site.record(5)
    (file,) = site.episodes.library.files()
    assert recordings.replay(file) == 1
    assert "mujoco" in capsys.readouterr().err
    assert recordings.replay(file, 7) == 1
    assert "no episode 7; its episodes: 1" in capsys.readouterr().err
    assert recordings.replay(tmp_path / "nothing.mcap") == 1
    assert "nothing.mcap" in capsys.readouterr().err


def test_a_summary_tells_figures_and_events(site: Site, tmp_path: Path):
    plant = Plant(catalog.load("h1"))
    metadata, packed = describe(
        plant.spec, plant.model, row_dtype(plant.model.nu, plant.save().size, 1, 0, 1), ["none"], None, ("stopped", "driving")
    )
    rows = np.zeros(100, metadata.dtype)
    rows["tick"], rows["state"], rows["applied"] = range(100), plant.save(), Command().vector()
    rows["mode"][20:], rows["reason"][20:] = 2, 1
    with (tmp_path / "lab.mcap").open("wb") as output:
        writer = EpisodeWriter(output, metadata, packed)  # pyright: ignore[reportArgumentType]
        writer.begin(EpisodeInfo("lab_001", 1, tmp_path / "lab.mcap", START, seed=7))
        writer.rows(rows)
        writer.end(START)
        writer.finish()
    assert site.json("GET", "")[0]["seed"] == 7
    told = site.json("GET", "/lab_001/summary")
    assert told["events"] == [
        {"seconds": 0.0, "kind": "stopped", "text": "stopped"},
        {"seconds": 0.4, "kind": "engaged", "text": "driving"},
    ]
    quality = told["quality"]
    assert (quality["seconds"], quality["engaged"], quality["falls"], quality["jerk"]) == (2.0, 1.6, 0, 0.0)
    assert 0 < quality["wrist_error"] < 0.5


def test_an_episode_that_cannot_be_judged_says_why(site: Site):
    id, _ = site.record(5)
    code, text = site.ask("GET", f"/{id}/summary")
    assert (code, "mujoco" in json.loads(text)["detail"]) == (409, True)
    open_one = site.json("POST", "", {"label": "wave"})["id"]
    assert site.ask("GET", f"/{open_one}/summary")[0] == 409
    assert site.ask("GET", "/nothing/summary")[0] == 404


@pytest.mark.parametrize("finished", [False, True])
def test_a_mark_can_be_changed_later(site: Site, finished: bool):
    (one, rows), (other, _) = site.record(20, label="wave", success=True), site.record(5, label="wave")
    if finished:
        site.episodes.recorder.release()
    told = site.json("POST", f"/{one}/label", {"success": False})
    assert (told["label"], told["success"]) == ("wave", False)
    assert site.json("POST", f"/{other}/label", {"success": None, "label": "bow"})["label"] == "bow"
    marks = {info["id"]: (info["label"], info["success"], info["rows"]) for info in site.json("GET", "")}
    assert marks == {one: ("wave", False, 20), other: ("bow", None, 5)}
    site.episodes.close()
    (file,) = site.episodes.library.files()
    with Recording(file) as recording:
        assert [(info.label, info.success) for info in recording.infos] == [("wave", False), ("bow", None)]
        assert recording.episode(recording.infos[0]).rows.tobytes() == rows.tobytes()


def test_the_open_episode_is_marked_when_it_stops(site: Site):
    id = site.json("POST", "")["id"]
    assert site.ask("POST", f"/{id}/label", {"success": True})[0] == 409
    assert site.ask("POST", "/nothing/label", {"success": True})[0] == 404


@pytest.mark.parametrize("order", ["label", "discard"])
def test_a_word_about_an_earlier_episode_costs_the_open_one_no_row(site: Site, order: str):
    earlier, _ = site.record(10)
    id = site.json("POST", "")["id"]
    first = site.push(30)
    site.ask("POST", f"/{earlier}/{order}", {"success": True} if order == "label" else None)
    second = site.push(30)
    site.json("POST", f"/{id}/stop", {})
    site.episodes.close()
    (file,) = site.episodes.library.files()
    with Recording(file) as recording:
        assert recording.episode(recording.infos[-1]).rows.tobytes() == np.concatenate([first, second]).tobytes()
