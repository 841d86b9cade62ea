"""How well an episode went: figures of its rows, and what happened in it."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from policies.command import AT
from policies.episode import MODES, Metadata, holes
from robots.senses import Senses
from robots.spec import RobotSpec
from robots.state import State

AT_LIMIT = np.deg2rad(1)
"""An arm joint this close to an end of its range is at its limit [rad]."""
ENGAGED, HOLD = MODES.index("ENGAGED"), MODES.index("HOLD")


@dataclass(frozen=True)
class Quality:
    """Figures of one run; those of tracking are means over the engaged rows, NaN without any."""

    seconds: float
    """Recorded."""
    engaged: float
    """Of these, with the operator engaged [s]."""
    falls: int
    """Times that the robot fell."""
    holds: int
    """Times that an engaged operator was lost or let go."""
    wrist_error: float
    """Distance of the wrists from where they were told to be [m]."""
    wrist_turn: float
    """Angle between them [rad]."""
    velocity_error: float
    """Absolute error of the forward and the leftward velocity, both added [m/s]."""
    yaw_rate_error: float
    """Absolute error [rad/s]."""
    jerk: float
    """Root mean square of the third derivative of the wrists' position in the pelvis frame, over all rows [m/s^3]."""
    at_limit: float
    """Share of rows in which an arm joint is at its limit."""


@dataclass(frozen=True)
class Event:
    """Something that happened."""

    seconds: float
    """Since the first row, counted in rows."""
    kind: str
    """engaged, hold, stopped, fault, fell, reset or gap."""
    text: str
    """As a sentence."""


class Judge:
    """Judges rows of one robot."""

    def __init__(self, model: mujoco.MjModel, spec: RobotSpec, metadata: Metadata) -> None:
        """`model` is the one that the rows were made with."""
        self._model, self._data, self._spec, self._metadata = model, mujoco.MjData(model), spec, metadata
        self._q = Senses(model, spec).q
        self._pelvis = model.body(spec.bodies[0].name).id
        self._sites = [model.site(name).id for name in spec.wrists]

    def quality(self, rows: np.ndarray) -> Quality:
        """Of rows of `metadata.dtype` [n], in order."""
        applied, engaged, rate = rows["applied"], rows["mode"] == ENGAGED, self._metadata.rate
        base, fallen = self._base(rows), self.fallen(rows)
        positions, quaternions = self._wrists(rows)
        asked, twist = applied[:, AT["wrists"]].reshape(-1, 2, 7), applied[:, AT["twist"]]
        distance = np.linalg.norm(positions - asked[..., :3], axis=-1).mean(-1)
        angle = 2 * np.arccos(np.clip(np.abs((quaternions * asked[..., 3:]).sum(-1)), 0, 1)).mean(-1)
        modes = rows["mode"].astype(int)
        return Quality(
            seconds=len(rows) / rate,
            engaged=float(engaged.sum()) / rate,
            falls=int(_risings(fallen).size),
            holds=int(((modes[1:] == HOLD) & (modes[:-1] == ENGAGED)).sum()),
            wrist_error=_mean(distance[engaged]),
            wrist_turn=_mean(angle[engaged]),
            velocity_error=_mean(np.abs(base.heading_velocity - twist[:, :2]).sum(-1)[engaged]),
            yaw_rate_error=_mean(np.abs(base.yaw_rate - twist[:, 2])[engaged]),
            jerk=self._jerk(rows, positions),
            at_limit=_mean(self._at_limit(rows)),
        )

    def events(self, rows: np.ndarray) -> list[Event]:
        """What happened in rows of `metadata.dtype` [n], in order of time."""
        rate, modes, reasons = self._metadata.rate, rows["mode"], self._metadata.reasons
        found = [Event(i / rate, "fell", "the robot fell") for i in _risings(self.fallen(rows))]
        for i in np.flatnonzero(np.diff(modes.astype(int), prepend=-1)):
            mode, reason = int(modes[i]), int(rows["reason"][i])
            kind = MODES[mode].lower() if mode < len(MODES) else str(mode)
            found.append(Event(i / rate, kind, reasons[reason] if reason < len(reasons) else str(reason)))
        found += [Event(i / rate, "reset", "put to another state from outside") for i in np.flatnonzero(rows["jump"])]
        ticks = rows["tick"].astype(np.int64)
        for before, after in holes(ticks):
            found.append(Event(float(np.searchsorted(ticks, after)) / rate, "gap", f"{after - before - 1} ticks are missing"))
        return sorted(found, key=lambda event: event.seconds)

    def fallen(self, rows: np.ndarray) -> np.ndarray:
        """Whether the robot lies, row by row [n]."""
        return self._base(rows).fallen(self._spec.nominal_height / 2)

    def _base(self, rows: np.ndarray) -> State:
        qpos, qvel, none = self._metadata.qpos(rows), rows["state"][:, 1 + self._metadata.nq :], np.empty(0)
        return State(
            time=rows["time"], position=qpos[:, :3], quaternion=qpos[:, 3:7], velocity=qvel[:, :3], gyro=qvel[:, 3:6],
            q=none, dq=none, feet=none, feet_velocity=none, touch=none,
        )  # fmt: skip

    def _wrists(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions [n, 2, 3] and quaternions [n, 2, 4] in the pelvis frame."""
        positions, quaternions = np.empty((len(rows), 2, 3)), np.empty((len(rows), 2, 4))
        data = self._data
        for row, qpos in enumerate(self._metadata.qpos(rows)):
            data.qpos[:] = qpos
            mujoco.mj_kinematics(self._model, data)
            R_world_pelvis, origin = data.xmat[self._pelvis].reshape(3, 3), data.xpos[self._pelvis]
            for side, site in enumerate(self._sites):
                positions[row, side] = R_world_pelvis.T @ (data.site_xpos[site] - origin)
                mujoco.mju_mat2Quat(quaternions[row, side], (R_world_pelvis.T @ data.site_xmat[site].reshape(3, 3)).ravel())
        return positions, quaternions

    def _jerk(self, rows: np.ndarray, positions: np.ndarray) -> float:
        """Over runs of four rows without a jump or a gap between them."""
        third = np.linalg.norm(np.diff(positions, n=3, axis=0), axis=-1) * self._metadata.rate**3
        follows = (np.diff(rows["tick"].astype(np.int64)) == 1) & (rows["jump"][1:] == 0)
        whole = follows[:-2] & follows[1:-1] & follows[2:]
        return float(np.sqrt(np.square(third[whole]).mean())) if whole.any() else float("nan")

    def _at_limit(self, rows: np.ndarray) -> np.ndarray:
        arms = self._spec.group("arms")
        q = self._metadata.qpos(rows)[:, self._q[arms]]
        near = (q < self._spec.lower[arms] + AT_LIMIT) | (q > self._spec.upper[arms] - AT_LIMIT)
        return near.any(axis=1)


def _risings(flags: np.ndarray) -> np.ndarray:
    """Where a flag becomes true."""
    return np.flatnonzero(flags & ~np.concatenate([[False], flags[:-1]]))


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if values.size else float("nan")
