"""The health record: what everybody may know about the robot and the loop that drives it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.inputs.operator import Operators
from app.mode import Mode, Reason
from app.protocol import Applied, Base, BothWrists, Health, Latency, Percentiles, Pose, Wrist
from app.simulation import Simulation
from policies.command import Command


@dataclass(frozen=True)
class Names:
    """What runs."""

    robot: str
    policy: str
    policy_rate: float
    """Ticks a second [Hz]."""


class Telemetry:
    """Reads the newest snapshot and the last 10 s of timing out of shared memory."""

    def __init__(self, names: Names, simulation: Simulation, operators: Operators) -> None:
        self._names, self._simulation, self._operators = names, simulation, operators

    def health(self, recording: str | None = None) -> Health:
        """The record of this moment. `recording` is the episode being recorded."""
        snapshot, lost = self._simulation.snapshot(), self._simulation.lost
        mode, reason = Mode(snapshot["mode"]), Reason(snapshot["reason"])
        if lost:
            mode, reason = Mode.FAULT, Reason.SIMULATION_LOST
        driver = self._operators.driver
        timing = self._timing()
        return Health(
            state=mode.name,
            reason=reason.sentence,
            robot=self._names.robot,
            policy=self._names.policy,
            time=float(snapshot["time"]),
            real_time_factor=0.0 if lost else self._real_time_factor(),
            ticks=int(snapshot["tick"]) + 1,
            missed=int(snapshot["missed"]),
            lateness_ms=_percentiles(timing[:, 5]),
            ik_ms=_percentiles(timing[:, 1]),
            latency_ms=Latency(**dict(zip(Latency.model_fields, np.median(timing, axis=0).round(3).tolist(), strict=True))),
            scheduler=self._simulation.scheduler,
            upright=bool(snapshot["upright"]),
            base=Base(**dict(zip(Base.model_fields, snapshot["base"].tolist(), strict=True))),
            command=_applied(Command.from_vector(snapshot["applied"])),
            wrists=BothWrists(left=_wrist(snapshot, 0), right=_wrist(snapshot, 1)),
            driver=driver.name if driver else None,
            clients=self._operators.count,
            rejected=self._operators.rejected + int(snapshot["rejected"]),
            recording=recording,
        )

    def _timing(self) -> np.ndarray:
        """policies.episode.STAGES of the last ticks [n, 6], ms."""
        return self._simulation.exchange.snapshots.column("latency")

    def _real_time_factor(self) -> float:
        stamps = self._simulation.exchange.snapshots.column("stamp")
        if len(stamps) < 2:
            return 1.0
        return (len(stamps) - 1) / self._names.policy_rate / float(stamps[-1] - stamps[0]) * 1e9


def _percentiles(values: np.ndarray) -> Percentiles:
    p50, p99 = np.percentile(values, [50, 99]).round(3).tolist()
    return Percentiles(p50=p50, p99=p99)


def _applied(command: Command) -> Applied:
    vx, vy, yaw_rate = command.twist.tolist()
    return Applied(vx=vx, vy=vy, yaw_rate=yaw_rate, height=command.height, roll=command.roll, pitch=command.pitch)


def _wrist(snapshot: np.void, side: int) -> Wrist:
    poses = {name: _pose(snapshot[name][side]) for name in ("target", "reachable", "actual")}
    return Wrist(**poses, limited_by=snapshot["limited_by"][side].decode(), let_go=bool(snapshot["let_go"][side]))


def _pose(row: np.ndarray) -> Pose:
    return Pose(position=tuple(row[:3].tolist()), quaternion=tuple(row[3:].tolist()))
