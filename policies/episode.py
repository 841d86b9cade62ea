"""What is recorded: one row a tick, on disk in MCAP files that survive a crash."""

from __future__ import annotations

import numpy as np

from policies import command

STAGES = ("queue", "ik", "policy", "physics", "publish", "lateness")
"""What the `latency` field of a row measures, in this order [ms]."""


def row_dtype(nu: int, nstate: int, nobs: int, nlatent: int, naction: int) -> np.dtype:
    """One tick as a packed little-endian record: what the simulation knew and did.

    Args:
        nu: motors of the stepped model.
        nstate: numbers of MuJoCo's mjSTATE_INTEGRATION.
        nobs: numbers of the leg policy's observation.
        nlatent: numbers of the motion prior's latent.
        naction: numbers of the leg policy's action.
    """
    return np.dtype(
        [
            ("tick", "<u8"),  # counts ticks since the simulation started; a missing number is a lost row
            ("time", "<f8"),  # simulated time before the step [s]
            ("wall", "<f8"),  # unix time [s]
            ("state", "<f8", (nstate,)),  # mjSTATE_INTEGRATION before the step
            ("ctrl", "<f8", (nu,)),  # motor targets of this tick [rad]
            ("raw", "<f8", (command.SIZE,)),  # Command.vector as received
            ("applied", "<f8", (command.SIZE,)),  # Command.vector after the guard
            ("observation", "<f4", (nobs,)),
            ("latent", "<f4", (nlatent,)),
            ("action", "<f4", (naction,)),
            ("latency", "<f4", (len(STAGES),)),  # ms, see STAGES
            ("mode", "u1"),  # STOPPED 0, HOLD 1, ENGAGED 2, FAULT 3
            ("jump", "u1"),  # 1: the state was set from outside before this tick (reset or restore)
            ("reason", "u1"),  # why the mode is what it is; the names stand in the file's metadata
        ]
    )
