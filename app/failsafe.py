"""Runs the policy and lets nothing bad through: the last good action for one tick, then a damped default pose and a fault."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

import numpy as np

from app import clock
from app.guard import Guarded
from app.mode import Mode, Reason
from policies.policy import Policy
from robots.spec import RobotSpec
from robots.state import State
from robots.target import Target

if TYPE_CHECKING:
    from policies.whole_body import Trace

SINK_SPEED = 1.0
"""How fast the joints go to the default pose [rad/s]."""
LATE = 0.2
"""An action that takes longer comes too late [s]. A machine that is merely busy is not a fault: simulated time waits for it,
the ticks it misses are counted, and a good action thrown away would be what makes the robot fall."""


class TracedPolicy(Policy, Protocol):
    """A policy whose inside is shown and recorded."""

    @property
    def trace(self) -> Trace:
        """The inside of the newest `act`."""
        ...

    def choose(self, index: int) -> None:
        """Walk with other weights from here on; the first ones are 0."""
        ...


class Failsafe:
    """Always returns a finite target for every motor."""

    def __init__(self, policy: TracedPolicy, spec: RobotSpec, report: Callable[[Reason], None]) -> None:
        """`report` is called with the fault when the policy failed twice in a row."""
        self.policy, self._report = policy, report
        self._home, self._dt = spec.home, 1 / spec.policy_rate
        self._good = self._home
        self._sunk: np.ndarray | None = None
        self._strikes = 0

    def reset(self, state: State) -> None:
        """The robot was put to `state`: forget the past."""
        self._good, self._sunk, self._strikes = self._home, None, 0
        self._guarded_call(lambda: self.policy.reset(state))

    def act(self, state: State, ruling: Guarded) -> Target:
        """Motor targets of this tick [nu]."""
        if ruling.mode == Mode.FAULT and ruling.reason in (Reason.FALLEN, Reason.POLICY_FAILED):
            return self._sink(state)
        started = clock.now()
        target = self._guarded_call(lambda: self.policy.act(state, ruling.command))
        in_time = clock.now() - started < LATE
        if target is not None and in_time and _usable(target.q, self._home.shape):
            self._good, self._strikes = target.q, 0
            return target
        self._strikes += 1
        if self._strikes == 1:
            return Target(self._good)
        self._report(Reason.POLICY_FAILED)
        return self._sink(state)

    def _guarded_call(self, call: Callable[[], Target | None]) -> Target | None:
        try:
            return call()
        except Exception:
            if self._strikes == 0:
                traceback.print_exc()
            return None

    def _sink(self, state: State) -> Target:
        """From where the joints are, slowly, to the default pose."""
        start = state.q if self._sunk is None else self._sunk
        step = SINK_SPEED * self._dt
        self._sunk = start + np.clip(self._home - start, -step, step)
        return Target(self._sunk)


def _usable(q: object, shape: tuple[int, ...]) -> bool:
    return isinstance(q, np.ndarray) and q.shape == shape and bool(np.isfinite(q).all())
