"""The simulation process: it keeps time, and it outlives nothing. Its failsafes need no help from the web process."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection

from app.clock import Ticker
from app.failsafe import TracedPolicy
from app.loop import Loop
from app.shared import Layout, Memory
from policies.errors import PolicyError
from robots.errors import RobotError
from robots.plant import Plant

Build = Callable[[], tuple[Plant, TracedPolicy]]
"""Makes the robot and its policy; picklable, called in the simulation process."""


@dataclass(frozen=True)
class Ready:
    """The robot stands and time runs."""

    layout: Layout
    scheduler: str
    """fifo: nothing but the kernel comes first; nice: ahead of ordinary processes; normal: like everybody else."""


@dataclass(frozen=True)
class Failed:
    """The robot could not be built."""

    sentence: str


def main(build: Build, memory: Memory, pipe: Connection, parent: int) -> None:
    """Run the loop until the process `parent` is gone or terminates this one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the parent decides
    try:
        loop = Loop(*build(), memory)
    except (RobotError, PolicyError) as error:
        pipe.send(Failed(str(error)))
        return
    except Exception as error:
        traceback.print_exc()
        pipe.send(Failed(f"the simulation could not start: {error!r}"))
        return
    with contextlib.suppress(OSError):  # a parent that is gone is noticed below
        pipe.send(Ready(loop.layout, hurry()))
    gc.collect()
    gc.freeze()
    gc.disable()
    ticker = Ticker(1 / loop.physics.plant.spec.policy_rate)
    while os.getppid() == parent:
        loop.tick(ticker.wait(), ticker.missed)


def hurry() -> str:
    """Take the best scheduling that this user may have; returns its name (see Ready)."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
        return "fifo"
    except (AttributeError, OSError):  # AttributeError: not Linux
        pass
    try:
        os.nice(-10)
        return "nice"
    except OSError:
        return "normal"
