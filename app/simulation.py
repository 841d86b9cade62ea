"""The web process's hold on the simulation process: starts it, listens whether it lives, starts it again."""

from __future__ import annotations

import multiprocessing
import os
import threading
import time

import numpy as np

from app import child, clock
from app.errors import SimulationFailed
from app.shared import Exchange, Memory
from policies.command import Command

SILENCE = 0.4
"""A simulation that published nothing for this long is lost [s]; it is shown within half a second."""
START = 120.0
"""The longest that building robot and policy may take [s]."""


class Simulation:
    """One simulation process at a time. What it shared stays readable when it is gone."""

    def __init__(self, build: child.Build) -> None:
        self._build, self._memory = build, Memory()
        self._context = multiprocessing.get_context("spawn")
        self._process = self._pipe = None
        self._restarting = threading.Lock()
        self.scheduler = ""
        """See app.child.Ready."""
        self.exchange: Exchange
        """There once `start` returned; stays the same when the process is started again."""

    def start(self) -> None:
        """Spawn the process; the robot is built beside whatever the caller does until `wait`."""
        self._pipe, theirs = self._context.Pipe(duplex=False)
        arguments = (self._build, self._memory, theirs, os.getpid())
        self._process = self._context.Process(target=child.main, args=arguments, name="simulation", daemon=True)
        self._process.start()
        theirs.close()

    def wait(self) -> None:
        """Until the robot stands.

        Raises:
            SimulationFailed: it could not be built; the message says why.
        """
        assert self._pipe is not None, "wait comes after start"
        try:
            message = self._pipe.recv() if self._pipe.poll(START) else child.Failed(f"the simulation took over {START:.0f} s to start")
        except EOFError:
            message = child.Failed("the simulation process died while it started")
        if isinstance(message, child.Failed):
            self.close()
            raise SimulationFailed(message.sentence)
        self.scheduler = message.scheduler
        self.exchange = Exchange(self._memory, message.layout)
        while self.lost and not self.dead:
            time.sleep(0.005)
        if self.lost:
            raise SimulationFailed("the simulation process died in its first tick")

    def restart(self) -> None:
        """End the process, whatever state it is in, and start another one at home. Blocks until it stands."""
        with self._restarting:
            if self.lost:
                self.close()
                self.start()
                self.wait()

    @property
    def pid(self) -> int | None:
        """Of the newest process."""
        return self._process and self._process.pid

    @property
    def dead(self) -> bool:
        """Whether the process is gone."""
        return self._process is None or not self._process.is_alive()

    @property
    def lost(self) -> bool:
        """Whether the process is dead or hangs."""
        now = clock.now()  # before the look: a busy machine may pause this thread in between
        newest = self.exchange.snapshots.newest()
        return self.dead or newest is None or now - newest["stamp"] * 1e-9 > SILENCE

    def snapshot(self) -> np.void:
        """The newest snapshot."""
        newest = self.exchange.snapshots.newest()
        assert newest is not None, "wait returns after the first one"
        return newest

    def applied(self) -> Command:
        """The command that the robot follows now."""
        return Command.from_vector(self.snapshot()["applied"])

    def close(self) -> None:
        """End the process; kill it if it does not obey."""
        if self._process is None:
            return
        self._process.terminate()
        self._process.join(1.0)
        if self._process.is_alive():  # stopped or stuck
            self._process.kill()
            self._process.join()
        self._process = None
