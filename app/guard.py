"""Decides every tick how far the operator is trusted: stopped, held, engaged, or a latched fault. Pure and deterministic."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from app.limiter import Limiter
from app.mode import Mode, Reason
from policies.command import SIZE, Command
from robots.state import State

SILENCE = 0.2
"""An operator who sent nothing for this long is lost [s]."""
FALLEN_TILT = np.deg2rad(60)
"""Beyond this tilt the robot has fallen [rad]; so it has below half of its nominal height."""


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
    lower[[0, 4]] = 0.0
    lower[21:33] = 0.0
    return lower, wide


_LOWER, _UPPER = _bounds()
"""No honest operator is outside these. Inside them, values beyond the trained ranges are clipped."""


def sane(vector: np.ndarray) -> bool:
    """Whether a command's vector is finite, inside the box and has unit quaternions."""
    if vector.shape != (SIZE,) or not np.all((vector >= _LOWER) & (vector <= _UPPER)):  # NaN fails both
        return False
    lengths = np.linalg.norm(vector[7:21].reshape(2, 7)[:, 3:], axis=1)
    return bool(np.all(np.abs(lengths - 1) < 0.01))


@dataclass(frozen=True)
class Ask:
    """The newest of what the web process asks; see app.shared.COMMAND."""

    serial: int
    """Grows with every command."""
    stamp: float
    """When the operator's newest message arrived, monotonic [s]."""
    vector: np.ndarray
    """Command.vector, unchecked [36]."""
    given: np.ndarray
    """Which wrists the driver has set, left and right [2]."""
    driver: int
    presses: int
    stops: int
    resets: int
    """Counters of leases, of fresh presses of Engage, of Stop and of Reset."""


SILENT = Ask(0, -np.inf, Command().vector(), np.zeros(2, dtype=bool), 0, 0, 0, 0)
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
        self._good, self._stamp = home, -np.inf
        self._now = np.inf
        self.reset(Reason.STARTED)

    def reset(self, reason: Reason = Reason.RESET) -> None:
        """Back to STOPPED at home; the robot has been put there."""
        self.mode, self.reason = Mode.STOPPED, reason
        self.limiter = Limiter(self.home, self.dt)

    def fault(self, reason: Reason) -> None:
        """Latch a fault; the first one stays."""
        if self.mode != Mode.FAULT:
            self.mode, self.reason = Mode.FAULT, reason

    def step(self, now: float, ask: Ask, state: State) -> Guarded:
        """What the robot may do in the tick that starts at `now` (monotonic, s) in `state`."""
        self._accept(now, ask)
        self._judge(now, ask, state)
        elapsed = max(self.dt, now - self._now)  # longer than a tick on a machine that misses some: it brakes in time too
        self._seen, self._now = ask, now
        engaged = self.mode == Mode.ENGAGED
        command = self.limiter.follow(self._good, ask.given) if engaged else self.limiter.hold(elapsed)
        return Guarded(command, self.mode, self.reason)

    def upright(self, state: State) -> bool:
        """Whether the robot has not fallen."""
        return bool(-state.gravity[2] > np.cos(FALLEN_TILT) and state.position[2] > self._lowest)

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
        self._good, self._stamp = good, ask.stamp

    def _judge(self, now: float, ask: Ask, state: State) -> None:
        """The mode of this tick, the most severe trigger first."""
        before = self._seen
        if not self.upright(state):
            self.fault(Reason.FALLEN)
        if self.mode == Mode.FAULT:
            return
        alive = now - self._stamp <= SILENCE
        if ask.stops != before.stops:
            self.mode, self.reason = Mode.STOPPED, Reason.STOP_PRESSED
        elif self.mode == Mode.ENGAGED:
            self._let_go_if(ask.driver != before.driver, Reason.TAKEN_OVER)
            self._let_go_if(not alive, Reason.SILENT)
            self._let_go_if(not self._good.engage, Reason.RELEASED)
        elif ask.presses != before.presses and self._good.engage and alive:
            self.mode, self.reason = Mode.ENGAGED, Reason.ENGAGED
            self.limiter.engage()

    def _let_go_if(self, lost: bool, reason: Reason) -> None:
        if lost and self.mode == Mode.ENGAGED:
            self.mode, self.reason = Mode.HOLD, reason


def ask_from(record: np.void | None, serial: int) -> Ask:
    """The Ask in a record of app.shared.COMMAND."""
    if record is None:
        return SILENT
    counters = {name: int(record[name]) for name in ("driver", "presses", "stops", "resets")}
    stamp = record["stamp"] * 1e-9 if record["stamp"] else -np.inf
    return replace(SILENT, serial=serial, stamp=stamp, vector=record["vector"], given=record["given"].astype(bool), **counters)
