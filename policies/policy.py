"""The protocol of everything that turns a command into motor targets."""

from __future__ import annotations

from typing import Protocol

from policies.command import Command
from robots.state import State
from robots.target import Target


class Policy(Protocol):
    """Called once a tick, in the simulation process."""

    def reset(self, state: State) -> None:
        """Forget the past; the robot stands at `state`."""
        ...

    def act(self, state: State, command: Command) -> Target:
        """Motor targets for this tick."""
        ...
