"""The commit beside a figure is ours or unknown, and nothing is lost over it."""

import subprocess
from pathlib import Path

import pytest

from policies import commit


@pytest.fixture(autouse=True)
def _fresh():
    commit.commit.cache_clear()
    yield
    commit.commit.cache_clear()


@pytest.mark.skipif(not (commit.CHECKOUT / ".git").exists(), reason="no checkout")
def test_it_is_that_of_this_checkout():
    asked = ["git", "rev-parse", "--short", "HEAD"]
    head = subprocess.run(asked, cwd=Path(__file__).parent, capture_output=True, text=True, check=True).stdout.strip()
    assert commit.commit().removesuffix("-dirty") == head


def test_without_git_on_the_machine_it_is_unknown(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PATH", "")
    assert commit.commit() == "unknown"


def test_another_repository_around_an_installed_program_is_not_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    subprocess.run(["git", "init", "-q", tmp_path], check=True)
    (tmp_path / "site-packages").mkdir()
    monkeypatch.setattr(commit, "CHECKOUT", tmp_path / "site-packages")
    assert commit.commit() == "unknown"
