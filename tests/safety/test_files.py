"""Files that somebody else made: weights and recordings that mean harm do nothing."""

from __future__ import annotations

import ast
import hashlib
import json
import os
import pickle
import random
import struct
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import mujoco
import pytest
import zstandard
from small_rows import METADATA, START, make_rows

from policies import checkpoint
from policies.episode import EpisodeInfo
from policies.errors import PolicyError
from policies.recording import trial
from policies.recording.model import CannotReplay, load_model, model_bytes
from policies.recording.reader import Recording
from policies.recording.session_file import SessionFile
from policies.recording.writer import EpisodeWriter

ROOT = Path(__file__).parents[2]
XML = """
<mujoco>
  <worldbody><body><freejoint/><geom size=".1"/><body pos="0 0 .3"><joint name="a"/><geom size=".1"/></body></body></worldbody>
  <actuator><motor joint="a"/><motor joint="a"/><motor joint="a"/></actuator>
</mujoco>
"""


class Evil:
    """Whoever unpickles this runs it."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self):
        return os.system, (f"touch {self.mark}",)


def evil_weights(mark: Path) -> dict[str, bytes]:
    huge = json.dumps({"x": {"dtype": "F32", "shape": [1 << 40], "data_offsets": [0, 1 << 42]}}).encode()
    return {
        "pickle": pickle.dumps(Evil(mark)),
        "nothing": b"",
        "noise": random.Random(0).randbytes(5000),
        "huge header": struct.pack("<Q", 1 << 62) + b"{}",
        "huge tensor": struct.pack("<Q", len(huge)) + huge,
        "cut off": checkpoint.find("walk_h1", "walk").read_bytes()[:1000],
    }


@pytest.mark.row(23)
@pytest.mark.parametrize("kind", list(evil_weights(Path())))
def test_weights_that_are_no_safetensors_are_refused_and_run_nothing(tmp_path: Path, kind: str, measured) -> None:
    mark, path = tmp_path / "ran", tmp_path / "evil.safetensors"
    path.write_bytes(evil_weights(mark)[kind])
    path.with_suffix(".json").write_text('{"kind": "walk"}')
    with pytest.raises(PolicyError, match=r"evil\.safetensors cannot be read"):
        checkpoint.load(path, {"kind": "walk"})
    assert not mark.exists()
    measured(23, f"{kind}: refused with a sentence, nothing ran")


@pytest.mark.row(23)
def test_a_card_that_means_harm_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "evil.safetensors"
    path.write_bytes(checkpoint.find("walk_h1", "walk").read_bytes())
    for card in ("", "[" * 100_000, '{"kind": "gr1"}', "\x00", "null"):
        path.with_suffix(".json").write_text(card)
        with pytest.raises(PolicyError):
            checkpoint.load(path, {"kind": "walk"})


def calls(path: Path) -> list[tuple[str, ast.Call]]:
    """Every call in a file: its dotted name and its node."""
    tree = ast.parse(path.read_text())
    return [(ast.unparse(node.func), node) for node in ast.walk(tree) if isinstance(node, ast.Call)]


SOURCES = [path for folder in ("app", "policies", "robots") for path in (ROOT / folder).rglob("*.py")]


@pytest.mark.row(23)
def test_nothing_in_the_program_unpickles_or_evaluates(measured) -> None:
    for path in SOURCES:
        text = path.read_text()
        assert not any(f"import {name}" in text for name in ("pickle", "dill", "joblib", "marshal", "shelve")), path
        for name, call in calls(path):
            options = {option.arg: ast.unparse(option.value) for option in call.keywords}
            assert name not in ("eval", "exec", "torch.jit.load", "yaml.load"), (path, name)
            assert name != "torch.load" or options.get("weights_only") == "True", path
            assert name != "np.load" or options.get("allow_pickle", "False") == "False", path
    measured(23, f"{len(SOURCES)} source files: no pickle, no eval; torch.load with weights_only, np.load without pickle")


@pytest.mark.row(24)
def test_the_only_models_from_outside_are_those_of_recordings(measured) -> None:
    found = {(path.relative_to(ROOT).as_posix(), name.rpartition(".")[2]) for path in SOURCES for name, _ in calls(path) if "Mj" in name}
    assert {(path, name) for path, name in found if name.startswith("from_")} <= {
        ("policies/recording/model.py", "from_binary_path"),
        ("policies/recording/trial.py", "from_binary_path"),
        ("app/exports/painter.py", "from_binary_path"),  # a copy of what load_model let through
    }
    measured(24, "no command, option or route takes MJCF; the model inside a recording is the only one from outside")


@pytest.fixture(scope="module")
def compiled() -> bytes:
    return model_bytes(mujoco.MjModel.from_xml_string(XML))


def recording(path: Path, compiled: bytes) -> Path:
    """A file of this program with any model inside."""
    model = mujoco.MjModel.from_xml_string(XML)
    versions = {"mujoco": mujoco.__version__}
    metadata = replace(METADATA, nq=model.nq, model_sha256=hashlib.sha256(compiled).hexdigest(), versions=versions)
    file = SessionFile(path)
    writer = EpisodeWriter(file, metadata, zstandard.compress(compiled))
    writer.begin(EpisodeInfo("evil_001", 1, file.path, START))
    writer.rows(make_rows(range(3)))
    writer.finish()
    file.publish()
    file.close()
    return path


@pytest.mark.row(24)
@pytest.mark.parametrize("count", [4, pytest.param(40, marks=pytest.mark.slow)])
def test_a_damaged_model_breaks_nothing_but_its_trial(tmp_path: Path, compiled: bytes, count: int, measured) -> None:
    dice, refused = random.Random(24), 0
    for i in range(count):
        evil = bytearray(compiled)
        for _ in range(dice.choice((1, 8, 200))):
            evil[dice.randrange(60, len(evil))] = dice.choice((0xFF, 0x80, 0, dice.randrange(256)))
        with Recording(recording(tmp_path / f"{i}.mcap", bytes(evil))) as opened:
            try:
                load_model(opened)
            except CannotReplay:
                refused += 1
    measured(24, f"{count} damaged models: {refused} refused, the others loaded; no crash")


@pytest.mark.row(24)
@pytest.mark.parametrize("limit", ["memory", "time"])
def test_a_trial_ends_at_its_limits(limit: str, measured) -> None:
    greedy = {"memory": "bytearray(8 << 30)", "time": "[0 for _ in iter(int, 1) if 0]"}[limit]
    script = f"import sys; from policies.recording import trial; trial.SECONDS = 1; trial.mujoco.MjData = lambda _: {greedy}; trial.main()"
    model = model_bytes(mujoco.MjModel.from_xml_string(XML))
    began = time.monotonic()
    ended = subprocess.run([sys.executable, "-c", script], input=model, capture_output=True, cwd=ROOT, timeout=60)
    assert ended.returncode != 0
    measured(24, f"a model that takes all {limit}: its trial ended after {time.monotonic() - began:.1f} s")


@pytest.mark.row(24)
def test_a_good_model_passes_its_trial(compiled: bytes) -> None:
    assert trial.survives(compiled)
    assert not trial.survives(compiled[:-10])
    assert not trial.survives(b"")


@pytest.mark.row(24)
def test_a_model_that_unpacks_to_gigabytes_is_refused(tmp_path: Path) -> None:
    path = recording(tmp_path / "bomb.mcap", bytes(100 << 20))
    with Recording(path) as opened:
        assert opened.model() is None
