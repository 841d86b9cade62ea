"""Simulates a recorded episode again and compares it with what was recorded, bit for bit."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from policies.episode import EpisodeInfo, Metadata
from policies.recording.model import load_model
from policies.recording.reader import Recording

STATE = mujoco.mjtState.mjSTATE_INTEGRATION
INPUTS = (
    mujoco.mjtState.mjSTATE_QFRC_APPLIED
    | mujoco.mjtState.mjSTATE_XFRC_APPLIED
    | mujoco.mjtState.mjSTATE_EQ_ACTIVE
    | mujoco.mjtState.mjSTATE_MOCAP_POS
    | mujoco.mjtState.mjSTATE_MOCAP_QUAT
    | mujoco.mjtState.mjSTATE_USERDATA
)
"""Parts of the state that somebody sets (a push, for example), beside ctrl."""


@dataclass(frozen=True)
class Replayed:
    """How a replay went."""

    info: EpisodeInfo
    rows: int
    segments: int
    """Pieces between gaps and jumps; each starts from its first logged state."""
    max_difference: float
    """Largest difference of qpos over all rows; inf when one side is not finite."""
    diverged_at: int | None
    """Tick of the first row whose qpos is not bit for bit the replayed one; None when all are."""


def replay(recording: Recording, info: EpisodeInfo) -> Replayed:
    """Step the recorded model from the first logged state with the logged motor targets, comparing qpos at every row.

    Raises:
        CannotReplay: as `load_model`.
    """
    player = _Player(recording.metadata, load_model(recording))
    for rows in recording.blocks(info.number):
        for row in rows:
            player.play(row)
    return Replayed(info, player.rows, player.segments, player.max_difference, player.diverged_at)


class _Player:
    def __init__(self, metadata: Metadata, model: mujoco.MjModel) -> None:
        self.rows, self.segments, self.max_difference = 0, 0, 0.0
        self.diverged_at: int | None = None
        self._metadata, self._model, self._data = metadata, model, mujoco.MjData(model)
        self._inputs = np.empty(mujoco.mj_stateSize(model, INPUTS))
        self._last_tick: int | None = None

    def play(self, row: np.void) -> None:
        """Compare with the row, then step from it."""
        model, data, state = self._model, self._data, np.ascontiguousarray(row["state"])
        if row["jump"] or self._last_tick is None or int(row["tick"]) != self._last_tick + 1:
            self.segments += 1
            mujoco.mj_setState(model, data, state, STATE)
        else:
            self._compare(row)
            mujoco.mj_extractState(model, state, STATE, self._inputs, INPUTS)
            mujoco.mj_setState(model, data, self._inputs, INPUTS)
        data.ctrl[:] = row["ctrl"]
        mujoco.mj_step(model, data, nstep=self._metadata.substeps)
        self._last_tick = int(row["tick"])
        self.rows += 1

    def _compare(self, row: np.void) -> None:
        logged = row["state"][1 : 1 + self._metadata.nq]
        if logged.tobytes() == self._data.qpos.tobytes():
            return
        if self.diverged_at is None:
            self.diverged_at = int(row["tick"])
        difference = float(np.abs(logged - self._data.qpos).max())
        self.max_difference = max(self.max_difference, difference if np.isfinite(difference) else np.inf)
