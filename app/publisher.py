"""Writes what happened in a tick: one snapshot for those who watch, one row for the recording."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from app import clock
from app.arbiter import ROLES
from app.guard import Ask, Guard
from app.mode import Mode
from app.physics import Physics
from app.shared import Exchange
from policies.command import Command
from robots.state import State
from robots.target import Target

if TYPE_CHECKING:
    from policies.whole_body import Trace


@dataclass(frozen=True)
class Tick:
    """What happened in one tick."""

    ask: Ask
    applied: Command
    """After the guard."""
    target: Target
    state: State
    """After the step."""
    trace: Trace
    latency: tuple[float, ...]
    """policies.episode.STAGES [ms]."""
    missed: int
    """Ticks skipped so far."""


class Publisher:
    """Fills one snapshot and one row over and over."""

    def __init__(self, exchange: Exchange, physics: Physics, guard: Guard) -> None:
        self._exchange, self._physics, self._guard = exchange, physics, guard
        self._snapshot = np.zeros((), exchange.snapshots.dtype)
        self._row = np.zeros((), exchange.rows.dtype)

    def publish(self, tick: Tick) -> None:
        """Push the row, then the snapshot: who sees a snapshot finds its row."""
        number = self._exchange.rows.count
        for record in (self._row, self._snapshot):
            record["tick"] = number
            record["mode"], record["reason"] = self._guard.mode, self._guard.reason
            record["jump"] = self._physics.jump
            record["latency"] = tick.latency
            record["applied"], record["policy"] = tick.applied.vector(), tick.ask.policy
        self._fill_row(tick)
        self._exchange.rows.push(self._row)
        self._fill_snapshot(tick)
        self._exchange.snapshots.push(self._snapshot)

    def _fill_row(self, tick: Tick) -> None:
        row, physics = self._row, self._physics
        row["time"] = physics.time
        row["wall"] = time.time()
        row["state"] = physics.before
        row["ctrl"] = tick.target.q
        row["raw"] = tick.ask.vector
        row["observation"], row["latent"], row["action"] = tick.trace.observation, tick.trace.latent, tick.trace.action

    def _fill_snapshot(self, tick: Tick) -> None:
        snapshot, state, guard = self._snapshot, tick.state, self._guard
        snapshot["time"] = state.time
        snapshot["qpos"] = self._physics.plant.data.qpos
        snapshot["base"] = base(state)
        applied = tick.applied.wrists
        snapshot["modes"], snapshot["reasons"] = guard.modes, guard.reasons
        asks = guard.modes[ROLES.index("arms")] == Mode.ENGAGED
        snapshot["target"] = np.where(asks & tick.ask.given[:, None], guard.asked.wrists, applied)
        snapshot["upper"] = tick.trace.reached.q
        snapshot["reachable"], snapshot["limited_by"] = tick.trace.reached.reachable, tick.trace.reached.reasons
        snapshot["actual"] = self._physics.wrists()
        snapshot["let_go"], snapshot["filter"] = guard.limiter.let_go, guard.limiter.delay * 1e3
        snapshot["missed"], snapshot["rejected"] = tick.missed, guard.rejected
        snapshot["upright"] = guard.upright(state)
        snapshot["stamp"] = clock.nanoseconds()


def base(state: State) -> np.ndarray:
    """x, y, z [m], yaw, roll, pitch [rad], velocity forward and left [m/s], yaw rate [rad/s] of the pelvis [9]."""
    return np.array([*state.position, state.yaw, *state.roll_pitch, *state.heading_velocity, state.yaw_rate])
