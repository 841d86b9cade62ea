"""What the guard lets the operator do, and why. The numbers stand in snapshots and recordings: only ever append."""

from __future__ import annotations

from enum import IntEnum


class Mode(IntEnum):
    """The more severe, the less the operator moves. The policy keeps balancing in all but some faults."""

    STOPPED = 0
    """Stands where it is; commands are ignored until a fresh press of Engage."""
    HOLD = 1
    """Stands with the last commanded posture; the operator let go or fell silent."""
    ENGAGED = 2
    """Follows the operator."""
    FAULT = 3
    """Latched until a reset."""


class Reason(IntEnum):
    """Why the mode is what it is."""

    STARTED = 0
    ENGAGED = 1
    RELEASED = 2
    SILENT = 3
    TAKEN_OVER = 4
    STOP_PRESSED = 5
    RESET = 6
    FALLEN = 7
    POLICY_FAILED = 8
    PHYSICS_DIVERGED = 9
    SIMULATION_LOST = 10

    @property
    def sentence(self) -> str:
        """What a person reads."""
        return _SENTENCES[self]


_SENTENCES = {
    Reason.STARTED: "standing; press Engage to drive",
    Reason.ENGAGED: "following the operator",
    Reason.RELEASED: "Engage is released",
    Reason.SILENT: "no message from the operator for 200 ms",
    Reason.TAKEN_OVER: "another operator took over; press Engage again",
    Reason.STOP_PRESSED: "stopped; press Engage to go on",
    Reason.RESET: "reset; press Engage to drive",
    Reason.FALLEN: "fallen; reset to stand up again",
    Reason.POLICY_FAILED: "the policy failed; reset to go on",
    Reason.PHYSICS_DIVERGED: "the physics diverged and was set back; reset to go on",
    Reason.SIMULATION_LOST: "the simulation process is gone or hangs; reset restarts it",
}
