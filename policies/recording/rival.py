"""Runs another policy through a recorded episode: the same commands and pushes from the same first state, then its own way."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from policies.command import Command
from policies.episode import MODES, EpisodeInfo
from policies.policy import Policy
from policies.recording.model import load_model
from policies.recording.quality import Judge, Quality
from policies.recording.reader import Recording
from policies.recording.replay import INPUTS, STATE
from robots.senses import Senses
from robots.spec import RobotSpec
from robots.state import State

FAULT = MODES.index("FAULT")


@dataclass(frozen=True)
class Divergence:
    """The first row in which the other policy did something else."""

    tick: int
    seconds: float
    """Since the first row."""
    motor: str
    """Whose target differs most."""
    difference: float
    """By so much [rad]."""


@dataclass(frozen=True)
class Compared:
    """Two runs of the same rows."""

    info: EpisodeInfo
    rows: int
    """Rows that both did. Rows in a fault are left out: there no policy drives."""
    segments: int
    """Pieces that start from their first logged state."""
    after_reset: bool
    """Every piece starts with a reset. Otherwise the policy's memory at its start is not in the recording, and even the policy that
    was recorded does not do the same."""
    divergence: Divergence | None
    """None: bit for bit the same."""
    recorded: Quality
    other: Quality


def compare(recording: Recording, info: EpisodeInfo, policy: Policy, spec: RobotSpec) -> Compared:
    """Run `policy` with the applied commands of an episode.

    Raises:
        CannotReplay: as `load_model`.
        ValueError: the episode has no row outside of a fault.
    """
    metadata, model = recording.metadata, load_model(recording)
    rows = recording.episode(info).rows
    logged = rows[rows["mode"] != FAULT]
    if not len(logged):
        raise ValueError(f"episode {info.id} has no row in which a policy drives")
    run = _Run(model, spec, policy, metadata.substeps)
    own = logged.copy()
    for before, row, written in zip([None, *logged[:-1]], logged, own, strict=True):
        run.tick(before, row, written)
    judge = Judge(model, spec, metadata)
    divergence = _first_difference(logged, own, metadata.rate, spec)
    return Compared(info, len(own), run.segments, run.after_reset, divergence, judge.quality(logged), judge.quality(own))


class _Run:
    def __init__(self, model: mujoco.MjModel, spec: RobotSpec, policy: Policy, substeps: int) -> None:
        self.segments, self.after_reset = 0, True
        self._model, self._data, self._substeps = model, mujoco.MjData(model), substeps
        self._policy, self._senses = policy, Senses(model, spec)
        self._inputs = np.empty(mujoco.mj_stateSize(model, INPUTS))

    def tick(self, before: np.void | None, row: np.void, written: np.void) -> None:
        """One row: the state that this run is in and its motor targets are put into `written`."""
        model, data, logged = self._model, self._data, np.ascontiguousarray(row["state"])
        if before is None or row["jump"] or row["tick"] != before["tick"] + 1:
            self._begin(logged, bool(row["jump"]))
        else:
            mujoco.mj_extractState(model, logged, STATE, self._inputs, INPUTS)
            mujoco.mj_setState(model, data, self._inputs, INPUTS)
        written["state"] = self._state()
        target = self._policy.act(self._sense(), Command.from_vector(row["applied"]))
        written["ctrl"] = data.ctrl[:] = target.q
        mujoco.mj_step(model, data, nstep=self._substeps)

    def _begin(self, logged: np.ndarray, jump: bool) -> None:
        self.segments, self.after_reset = self.segments + 1, self.after_reset and jump
        mujoco.mj_setState(self._model, self._data, logged, STATE)
        mujoco.mj_forward(self._model, self._data)
        self._policy.reset(self._sense())
        mujoco.mj_setState(self._model, self._data, logged, STATE)

    def _state(self) -> np.ndarray:
        state = np.empty(mujoco.mj_stateSize(self._model, STATE))
        mujoco.mj_getState(self._model, self._data, state, STATE)
        return state

    def _sense(self) -> State:
        data = self._data
        return self._senses.read(np.array(data.time), data.qpos, data.qvel, data.sensordata)


def _first_difference(logged: np.ndarray, own: np.ndarray, rate: float, spec: RobotSpec) -> Divergence | None:
    different = (logged["ctrl"] != own["ctrl"]).any(axis=1)
    if not different.any():
        return None
    row = int(different.argmax())
    apart = np.abs(logged["ctrl"][row] - own["ctrl"][row])
    return Divergence(int(logged["tick"][row]), row / rate, spec.motor_names[int(apart.argmax())], float(apart.max()))
