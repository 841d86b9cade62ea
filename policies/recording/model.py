"""The compiled MuJoCo model that travels with a recording."""

from __future__ import annotations

import hashlib

import mujoco
import numpy as np

from policies.recording import trial
from policies.recording.reader import Recording
from robots import catalog


class CannotReplay(Exception):
    """A recording whose model cannot be stepped here."""


def model_bytes(model: mujoco.MjModel) -> bytes:
    """The model as MuJoCo's binary MJB, which only the same MuJoCo version reads."""
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


def load_model(recording: Recording) -> mujoco.MjModel:
    """The model that the rows were made with: the attached one, or that of the catalog when it is the very same.

    Raises:
        CannotReplay: another MuJoCo version, or no such model.
    """
    metadata, path = recording.metadata, recording.path
    made_with, here = metadata.versions.get("mujoco"), mujoco.__version__
    if made_with != here:
        raise CannotReplay(f"{path} was recorded with mujoco {made_with}, here is {here}; install mujoco=={made_with} to replay it")
    model = _attached(recording) or _built_again(recording)
    if model is None:
        raise CannotReplay(f"{path} has no intact model inside; its rows can be read but not replayed")
    sizes = (model.nq, model.nu, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION))
    if sizes != (metadata.nq, metadata.dtype["ctrl"].shape[0], metadata.dtype["state"].shape[0]):
        raise CannotReplay(f"{path}: the model inside does not fit its rows; its rows can be read but not replayed")
    return model


def _attached(recording: Recording) -> mujoco.MjModel | None:
    compiled = recording.model()
    if compiled is None or hashlib.sha256(compiled).hexdigest() != recording.metadata.model_sha256 or not trial.survives(compiled):
        return None
    try:
        return mujoco.MjModel.from_binary_path("model.mjb", {"model.mjb": compiled})
    except (ValueError, mujoco.FatalError):
        return None


def _built_again(recording: Recording) -> mujoco.MjModel | None:
    if recording.metadata.robot not in catalog.known():
        return None
    model = catalog.load(recording.metadata.robot).model("play")
    same = hashlib.sha256(model_bytes(model)).hexdigest() == recording.metadata.model_sha256
    return model if same else None
