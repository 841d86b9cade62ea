"""Decides every tick how far the operators are trusted: stopped, held, engaged, or a latched fault. Pure and deterministic.

Each role (arms, legs) is held and engaged by itself, for its driver's own Engage and silence: whoever is lost stops what they
drove, and nobody else's hands are frozen. STOPPED and FAULT are the whole robot's; so is the mode that is told: the most severe
of the roles that somebody drives.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from app.arbiter import ROLES
from app.limiter import Limiter
from app.mode import Mode, Reason
from policies.command import AT, SIZE, Command
from robots.state import State

SILENCE = 0.2
"""An operator who sent nothing for this long is lost [s]."""


def _bounds() -> tuple[np.ndarray, np.ndarray]:
    wide = Command(
        engage=True,
        twist=np.full(3, 10.0),
        height=3.0,
        roll=2.0,
        pitch=2.0,
        wrists=np.tile([1.5, 1.5, 1.5, 1.01, 1.01, 1.01, 1.01], (2, 1)),
        hands=np.full((2, 6), 1.0),
        neck=np.full(2, 4.0),
        waist=4.0,
    ).vector()
    lower = -wide
    for field in ("engage", "height", "hands"):
        lower[AT[field]] = 0.0
    return lower, wide


_LOWER, _UPPER = _bounds()
"""No honest operator is outside these. Inside them, values beyond the trained ranges are clipped."""


def sane(vector: np.ndarray) -> bool:
    """Whether a command's vector is finite, inside the box and has unit quaternions."""
    if vector.shape != (SIZE,) or not np.all((vector >= _LOWER) & (vector <= _UPPER)):  # NaN fails both
        return False
    lengths = np.linalg.norm(vector[AT["wrists"]].reshape(2, 7)[:, 3:], axis=1)
    return bool(np.all(np.abs(lengths - 1) < 0.01))


@dataclass(frozen=True)
class Ask:
    """The newest of what the web process asks; see app.shared.COMMAND."""

    serial: int
    """Grows with every command."""
    vector: np.ndarray
    """Command.vector, unchecked [36]."""
    given: np.ndarray
    """Which wrists the driver has set, left and right [2]."""
    smooth: bool
    """Whether the wrists' targets shall be filtered."""
    stamps: np.ndarray
    """When the driver's newest message arrived, a role (app.arbiter.ROLES), monotonic [2], s; -inf: nobody drives."""
    engage: np.ndarray
    """Whether the driver holds Engage, a role [2]."""
    driver: np.ndarray
    presses: np.ndarray
    """Counters of leases and of fresh presses of Engage, a role [2]."""
    stops: int
    resets: int
    """Counters of Stop and of Reset."""
    seed: int = 0
    """Where the newest reset puts the robot (see Plant.reset)."""
    policy: int = 0
    """Which leg weights shall walk."""

    @property
    def stamp(self) -> float:
        """When anybody's newest message arrived, monotonic [s]."""
        return float(self.stamps.max())


NOBODY, NONE = np.full(2, -np.inf), np.zeros(2, dtype=int)
SILENT = Ask(0, Command().vector(), NONE.astype(bool), False, NOBODY, NONE.astype(bool), NONE, NONE, 0, 0)
"""What is asked before anybody asked anything."""


@dataclass(frozen=True)
class Guarded:
    """What the robot may do this tick."""

    command: Command
    mode: Mode
    reason: Reason


class Guard:
    """One robot's failsafes. FAULT latches until `reset`; of several triggers the most severe wins."""

    def __init__(self, home: Command, nominal_height: float, dt: float, ask: Ask = SILENT) -> None:
        """Start STOPPED in the posture `home`. What `ask` holds already is no fresh press.

        Args:
            home: the posture in which the robot stands at home.
            nominal_height: of the pelvis [m].
            dt: duration of a tick [s].
            ask: the newest command.
        """
        self.home, self.dt, self._lowest = home, dt, nominal_height / 2
        self.rejected = 0
        self._seen, self._serial = ask, ask.serial
        self._good, self._stamps = home, NOBODY
        self._now = np.inf
        self.reset(Reason.STARTED)

    def reset(self, reason: Reason = Reason.RESET, wrists: np.ndarray | None = None) -> None:
        """Back to STOPPED at home; the robot has been put there. Its arms stay where `wrists` [2, 7] are."""
        self._put(Mode.STOPPED, reason)
        self.limiter = Limiter(self.home if wrists is None else replace(self.home, wrists=wrists), self.dt)

    def fault(self, reason: Reason) -> None:
        """Latch a fault; the first one stays."""
        if self.mode != Mode.FAULT:
            self._put(Mode.FAULT, reason)

    def step(self, now: float, ask: Ask, state: State) -> Guarded:
        """What the robot may do in the tick that starts at `now` (monotonic, s) in `state`."""
        self._accept(now, ask)
        self._judge(now, ask, state)
        elapsed = max(self.dt, now - self._now)  # longer than a tick on a machine that misses some: it brakes in time too
        self._seen, self._now = ask, now
        arms, legs = (mode == Mode.ENGAGED for mode in self.modes)
        command = self.limiter.step(self._good, ask.given, ask.smooth, arms, legs, elapsed)
        return Guarded(command, self.mode, self.reason)

    @property
    def mode(self) -> Mode:
        """The whole robot's."""
        return self.modes[self._told]

    @property
    def reason(self) -> Reason:
        """Why it is the mode."""
        return self.reasons[self._told]

    def upright(self, state: State) -> bool:
        """Whether the robot has not fallen."""
        return not state.fallen(self._lowest)

    @property
    def asked(self) -> Command:
        """The newest command that was accepted."""
        return self._good

    def _accept(self, now: float, ask: Ask) -> None:
        """Keep a good command; a bad one is counted and does not count as a sign of life."""
        if ask.serial == self._serial:
            return
        self._serial = ask.serial
        if not sane(ask.vector) or ask.stamp > now + 1.0:
            self.rejected += 1
            return
        good = Command.from_vector(ask.vector)
        quaternions = good.wrists[:, 3:]
        quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
        self._good, self._stamps = good, ask.stamps

    def _judge(self, now: float, ask: Ask, state: State) -> None:
        """The modes of this tick, the most severe trigger first."""
        if not self.upright(state):
            self.fault(Reason.FALLEN)
        if self.mode == Mode.FAULT:
            return
        if ask.stops != self._seen.stops:
            self._put(Mode.STOPPED, Reason.STOP_PRESSED)
            return
        for role in range(len(ROLES)):
            self._judge_role(role, ask, alive=now - self._stamps[role] <= SILENCE)
        if Mode.ENGAGED in self.modes:
            self.modes = [Mode.HOLD if mode == Mode.STOPPED else mode for mode in self.modes]

    def _judge_role(self, role: int, ask: Ask, alive: bool) -> None:
        before, engage = self._seen, bool(ask.engage[role])
        if self.modes[role] == Mode.ENGAGED:
            self._let_go_if(role, ask.driver[role] != before.driver[role], Reason.TAKEN_OVER)
            self._let_go_if(role, not alive, Reason.SILENT)
            self._let_go_if(role, not engage, Reason.RELEASED)
        elif ask.presses[role] != before.presses[role] and engage and alive:
            self.modes[role], self.reasons[role] = Mode.ENGAGED, Reason.ENGAGED
            if ROLES[role] == "arms":
                self.limiter.engage()

    def _let_go_if(self, role: int, lost: bool, reason: Reason) -> None:
        if lost and self.modes[role] == Mode.ENGAGED:
            self.modes[role], self.reasons[role] = Mode.HOLD, reason

    def _put(self, mode: Mode, reason: Reason) -> None:
        self.modes, self.reasons = [mode] * len(ROLES), [reason] * len(ROLES)

    @property
    def _told(self) -> int:
        """The role whose mode is the whole robot's: the most severe, of those that somebody drives."""
        driven = [role for role in range(len(ROLES)) if np.isfinite(self._stamps[role])] or range(len(ROLES))
        return min(driven, key=lambda role: self.modes[role] == Mode.ENGAGED)  # STOPPED and FAULT are never one role's alone


def ask_from(record: np.void | None, serial: int) -> Ask:
    """The Ask in a record of app.shared.COMMAND."""
    if record is None:
        return SILENT
    stamps = np.where(record["stamp"] != 0, record["stamp"] * 1e-9, -np.inf)
    flags = {name: record[name].astype(bool) for name in ("given", "engage")}
    counters = {name: record[name].astype(int) for name in ("driver", "presses")}
    counts = {"stops": int(record["stops"]), "resets": int(record["resets"]), "seed": int(record["seed"])}
    counts["policy"] = int(record["policy"])
    told = {"serial": serial, "vector": record["vector"], "smooth": bool(record["smooth"]), "stamps": stamps}
    return replace(SILENT, **told, **flags, **counters, **counts)
