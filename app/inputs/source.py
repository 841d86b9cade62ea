"""What a source of commands in this program is; a page, a headset and a script are the same from outside, through a socket."""

from __future__ import annotations

from collections.abc import Collection
from typing import Protocol

from app.arbiter import Role
from app.protocol import OperatorMessage
from policies.command import Command


class Source(Protocol):
    """Says what an operator's page would say. It takes its roles where they are free, is taken over from, held and stopped alike."""

    name: str
    """How others see it."""

    def message(self, seq: int, seconds: float, applied: Command, taken: Collection[Role]) -> OperatorMessage | None:
        """The message of this moment; None ends it.

        Args:
            seq: the message's number.
            seconds: since the first message, which had 0.
            applied: what the robot does now.
            taken: what somebody else drives.
        """
        ...
