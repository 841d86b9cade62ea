"""Says what makes the rows: packages, commit, robot, policy, model."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import mujoco
import numpy as np
import zstandard

from policies.commit import commit
from policies.episode import Metadata
from policies.recording.model import model_bytes
from robots.spec import RobotSpec

_PACKAGES = ("humanoid-teleop", "mujoco", "numpy", "torch", "mink", "mcap")


def describe(
    spec: RobotSpec,
    model: mujoco.MjModel,
    dtype: np.dtype,
    policies: Sequence[str],
    weights: Path | None = None,
    reasons: Sequence[str] = (),
) -> tuple[Metadata, bytes]:
    """The metadata of a recording and the compiled model that its rows were made with: MJB, compressed with zstd.

    It takes a good part of a second: call it before somebody waits.

    Args:
        spec: the robot.
        model: the stepped model.
        dtype: layout of a row.
        policies: names of the leg policies that can walk; the robot begins with the first.
        weights: file of the first.
        reasons: meaning of the `reason` field by its value.
    """
    compiled = model_bytes(model)
    metadata = Metadata(
        robot=spec.name,
        policy=policies[0],
        policies=tuple(policies),
        dtype=dtype,
        nq=model.nq,
        nv=model.nv,
        substeps=round(1 / (spec.policy_rate * model.opt.timestep)),
        rate=spec.policy_rate,
        policy_sha256="" if weights is None else hashlib.sha256(weights.read_bytes()).hexdigest(),
        model_sha256=hashlib.sha256(compiled).hexdigest(),
        reasons=tuple(reasons),
        versions=_versions(),
        commit=commit(),
    )
    return metadata, zstandard.compress(compiled)


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version(), "machine": platform.machine()}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found
