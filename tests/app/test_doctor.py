"""`teleop doctor`: what it finds, what it advises, how it ends."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from app import doctor
from app.doctor import Finding


def verdicts(findings: list[Finding]) -> dict[str, str]:
    return {finding.what: finding.verdict for finding in findings}


def test_it_looks_at_everything_and_a_taken_port_is_bad(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        assert doctor.main("h1", port, tmp_path / "recordings") == 1
    told = capsys.readouterr().out
    for what in ("python", "processors", "scheduling", "port", "disk", "browser", "meshes", "physics", "rendering"):
        assert f" {what} " in told
    assert "--port" in told
    assert not (tmp_path / "recordings").exists(), "it changes nothing"


def test_nothing_bad_is_success(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "examine", lambda *_: [Finding("disk", "poor", "full", "make room")])
    assert doctor.main("h1", 0, tmp_path) == 0


def test_what_is_poor_comes_with_advice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "ROOM", 1 << 60)
    monkeypatch.setattr(doctor, "BROWSERS", ("no-such-browser",))
    for finding in (doctor._disk(tmp_path), doctor._browser()):
        assert finding.verdict == "poor"
        assert finding.advice
    assert doctor._disk(Path("/proc/nowhere")).verdict == "bad"


def test_a_check_that_breaks_is_a_finding(tmp_path: Path) -> None:
    findings = list(doctor.examine("no such robot", 0, tmp_path))
    assert sum(finding.verdict == "bad" for finding in findings) == 2
    assert "no such robot" in findings[-2].found
