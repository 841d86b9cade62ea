"""The health record: what everybody may know about the robot and the loop that drives it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from app import clock
from app.arbiter import Role
from app.inputs.operator import Client, Operators
from app.mode import Mode, Reason
from app.protocol import Applied, Base, BothWrists, Hands, Health, Latency, Neck, PageTiming, Part, Parts, Percentiles, Pose, Twist, Wrist
from app.shared import Ring
from app.simulation import Simulation
from policies.command import Command
from policies.episode import STAGES

NO_PAGE: dict[str, Any] = dict.fromkeys(PageTiming.model_fields)
"""Stages that only a page can time, and no page that told."""
STATISTICS_PERIOD = 0.5
"""How often percentiles are taken [s]."""


@dataclass(frozen=True)
class Names:
    """What runs."""

    robot: str
    policies: tuple[str, ...]
    """Leg weights that can walk; the robot begins with the first."""
    policy_rate: float
    """Ticks a second [Hz]."""


@dataclass(frozen=True)
class Timing:
    """Of the last 10 s."""

    real_time_factor: float
    lateness_ms: Percentiles
    ik_ms: Percentiles
    latency_ms: Latency


class Telemetry:
    """Reads the newest snapshot and the last 10 s of timing out of shared memory."""

    def __init__(self, names: Names, simulation: Simulation, operators: Operators) -> None:
        self._names, self._simulation, self._operators = names, simulation, operators
        self._statistics: Timing | None = None
        self._measured = 0.0

    def health(self, recording: str | None = None, recording_alarm: str | None = None) -> Health:
        """The record of this moment. `recording` is the episode being recorded, `recording_alarm` what is wrong with its disk."""
        snapshot, lost = self._simulation.snapshot(), self._simulation.lost
        mode, reason = (Mode.FAULT, Reason.SIMULATION_LOST) if lost else (Mode(snapshot["mode"]), Reason(snapshot["reason"]))
        drivers, timing = self._operators.drivers, self._timing()
        return Health(
            state=mode.name,
            reason=reason.sentence,
            roles=_parts(snapshot, drivers, lost),
            robot=self._names.robot,
            policy=self._names.policies[snapshot["policy"]],
            policies=list(self._names.policies),
            time=float(snapshot["time"]),
            real_time_factor=0.0 if lost else timing.real_time_factor,
            ticks=int(snapshot["tick"]) + 1,
            missed=int(snapshot["missed"]),
            lateness_ms=timing.lateness_ms,
            ik_ms=timing.ik_ms,
            latency_ms=_with_page(timing.latency_ms, drivers),
            filter_ms=round(float(snapshot["filter"]), 1),
            scheduler=self._simulation.scheduler,
            upright=bool(snapshot["upright"]),
            base=Base(**dict(zip(Base.model_fields, snapshot["base"].tolist(), strict=True))),
            command=_applied(Command.from_vector(snapshot["applied"])),
            wrists=BothWrists(left=_wrist(snapshot, 0), right=_wrist(snapshot, 1)),
            driver=" and ".join(dict.fromkeys(driver.name for driver in drivers.values() if driver)) or None,
            clients=len(self._operators.clients),
            rejected=self._operators.rejected + int(snapshot["rejected"]),
            recording=recording,
            recording_alarm=recording_alarm,
        )

    def _timing(self) -> Timing:
        """At most STATISTICS_PERIOD old."""
        if self._statistics is None or clock.now() - self._measured > STATISTICS_PERIOD:
            self._statistics, self._measured = _measure(self._simulation.exchange.snapshots, self._names.policy_rate), clock.now()
        return self._statistics


def _with_page(latency: Latency, drivers: dict[Role, Client | None]) -> Latency:
    """With what the drivers' pages timed."""
    told = [dict(driver.timing) for driver in drivers.values() if driver]
    return latency.model_copy(update={name: next((t[name] for t in told if t[name] is not None), None) for name in NO_PAGE})


def _parts(snapshot: np.void, drivers: dict[Role, Client | None], lost: bool) -> Parts:
    parts = {}
    for i, (role, driver) in enumerate(drivers.items()):
        mode, reason = (Mode.FAULT, Reason.SIMULATION_LOST) if lost else (Mode(snapshot["modes"][i]), Reason(snapshot["reasons"][i]))
        parts[role] = Part(driver=driver.name if driver else None, state=mode.name, reason=reason.sentence)
    return Parts(**parts)


def _measure(snapshots: Ring, policy_rate: float) -> Timing:
    stages = snapshots.column("latency").astype(float)
    stamps = snapshots.column("stamp")
    wall = float(stamps[-1] - stamps[0]) * 1e-9
    medians: dict[str, Any] = dict(zip(STAGES, np.median(stages, axis=0).round(3).tolist(), strict=True))
    return Timing(
        real_time_factor=(len(stamps) - 1) / policy_rate / wall if wall > 0 else 1.0,
        lateness_ms=_percentiles(stages[:, STAGES.index("lateness")]),
        ik_ms=_percentiles(stages[:, STAGES.index("ik")]),
        latency_ms=Latency(**medians, **NO_PAGE),
    )


def _percentiles(values: np.ndarray) -> Percentiles:
    p50, p99 = np.percentile(values, [50, 99]).round(3).tolist()
    return Percentiles(p50=p50, p99=p99)


def _applied(command: Command) -> Applied:
    scalars = {name: getattr(command, name) for name in ("height", "roll", "pitch", "waist")}
    twist = dict(zip(Twist.model_fields, command.twist.tolist(), strict=True))
    left, right = map(tuple, command.hands.tolist())
    yaw, pitch = command.neck.tolist()
    return Applied(**twist, **scalars, hands=Hands(left=left, right=right), neck=Neck(yaw=yaw, pitch=pitch))


def _wrist(snapshot: np.void, side: int) -> Wrist:
    poses = {name: _pose(snapshot[name][side]) for name in ("target", "reachable", "actual")}
    return Wrist(**poses, limited_by=snapshot["limited_by"][side].decode(), let_go=bool(snapshot["let_go"][side]))


def _pose(row: np.ndarray) -> Pose:
    return Pose(position=tuple(row[:3].tolist()), quaternion=tuple(row[3:].tolist()))
