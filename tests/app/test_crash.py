"""kill -9 of the whole program while it records, from the outside."""

import json
import os
import re
import signal
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from typing import Any

import pytest
from stand_ins import eventually

from app import recordings
from policies.recording.reader import Recording


@pytest.mark.row(2, 13)
def test_what_was_recorded_before_a_kill_recovers_and_replays(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "app", "--port", "0", "--recordings", str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parents[2], start_new_session=True) as teleop:
        try:
            assert teleop.stdout is not None
            found = re.search(r"http://127\.0\.0\.1:\d+", teleop.stdout.readline())
            assert found
            api = found[0] + "/api"
            id = _ask("POST", f"{api}/episodes", {"label": "killed"})["id"]
            time.sleep(1.5)
            _ask("POST", f"{api}/reset")
            time.sleep(1.0)
            ticks = _ask("GET", f"{api}/health")["ticks"]
        finally:
            os.killpg(teleop.pid, signal.SIGKILL)
    (file,) = tmp_path.glob("*.mcap")
    eventually(lambda: recordings.recover(file) == 0)
    with Recording(file) as recording:
        (episode,) = recording.episodes()
    assert (episode.info.id, episode.info.label, episode.info.ended, episode.info.gaps) == (id, "killed", "truncated", 0)
    assert (ticks - 1 - int(episode.rows["tick"][-1])) / 50 <= 0.5
    assert episode.rows["jump"].sum() == 1
    assert recordings.replay(file) == 0


def _ask(method: str, url: str, body: Any = None) -> Any:
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(url, data, {"Content-Type": "application/json"}, method=method)
    with urllib.request.urlopen(request, timeout=30) as answer:
        return json.load(answer)
