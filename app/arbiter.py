"""Who drives: one lease at a time. Everybody else watches; anyone may stop."""

from __future__ import annotations

SILENCE = 2.0
"""A driver who says nothing for this long loses the lease [s]."""


class Lease:
    """The right to write the robot's command, or a part of it: another part is another lease. Times are monotonic [s]."""

    def __init__(self) -> None:
        self.holder: str | None = None
        """The client who drives."""
        self.number = 0
        """Counts the times that the lease was given."""
        self._heard = 0.0

    def hear(self, client: str, now: float, wants: bool = False, takes: bool = False) -> bool:
        """A client said something. Returns whether it holds the lease from here on.

        Args:
            client: who.
            now: when.
            wants: it would drive, if nobody does.
            takes: it takes the lease from whoever drives.
        """
        self.expire(now)
        if client != self.holder and (takes or (wants and self.holder is None)):
            self.holder, self.number = client, self.number + 1
        if client != self.holder:
            return False
        self._heard = now
        return True

    def leave(self, client: str) -> bool:
        """A client is gone. Returns whether it was the one who drove."""
        drove = client == self.holder
        if drove:
            self.holder = None
        return drove

    def expire(self, now: float) -> None:
        """Free the lease of a driver who fell silent."""
        if now - self._heard > SILENCE:
            self.holder = None
