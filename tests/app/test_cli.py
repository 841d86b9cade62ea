"""`teleop` as a person meets it: help, one sentence for each mistake, a clean end."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest
from stand_ins import eventually

from app.cli import main


def test_help_names_the_commands_and_gives_examples(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--help"])
    assert ended.value.code == 0
    told = capsys.readouterr().out
    assert all(word in told for word in ("serve", "episodes", "replay", "recover", "examples:", "--port"))


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--robot", "g2"], r"no robot named 'g2'; known robots: .*h1"),
        (["serve", "--policy", "nobody"], r"no policy named 'nobody'; known policies: "),
        (["--host", "0.0.0.0"], r"can be reached from other machines"),
        (["--host", "example.org"], r"can be reached from other machines"),
        (["--port", "99999"], r"cannot listen on 127.0.0.1:99999"),
        (["--certificate", "nowhere.pem"], r"the certificate cannot be used .*--key"),
        (["--key", "nowhere.pem"], r"there is a key but no certificate"),
        (["--token", __file__], r"chmod 600|holds no token"),
    ],
)
def test_a_mistake_is_one_sentence(arguments: list[str], sentence: str, capsys: pytest.CaptureFixture[str]) -> None:
    defaults = [] if "--port" in arguments else ["--port", "0"]
    assert main([*arguments, *defaults]) == 1
    told = capsys.readouterr()
    assert re.search(sentence, told.err)
    assert told.err.count("\n") == 1
    assert not told.out


def test_a_taken_port_is_one_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        assert main(["--port", str(other.getsockname()[1])]) == 1
    assert "is taken by another program" in capsys.readouterr().err


def test_a_command_that_is_broken_off_has_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    def breaks_off(*_: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr("app.recordings.replay", breaks_off)
    assert main(["replay", "some.mcap"]) == 130


def test_it_serves_a_standing_robot_and_ends_cleanly_with_ctrl_c(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "app", "--port", "0", "--recordings", str(tmp_path / "recordings")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=Path(__file__).parents[2]) as teleop:
        assert teleop.stdout is not None
        assert teleop.stderr is not None
        found = re.search(r"http://127\.0\.0\.1:\d+", teleop.stdout.readline())
        assert found, teleop.stderr.read()
        with urllib.request.urlopen(found[0] + "/api/health", timeout=30) as answer:
            health = json.load(answer)
        assert (health["state"], health["upright"]) == ("STOPPED", True)
        children = Path(f"/proc/{teleop.pid}/task/{teleop.pid}/children").read_text().split()
        os.kill(teleop.pid, signal.SIGINT)
        assert teleop.wait(20) == 0
        assert not teleop.stderr.read()
        eventually(lambda: not any(Path(f"/proc/{pid}/task").exists() for pid in children))
