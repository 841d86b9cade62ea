"""Who drives what: one lease a role, and one driver a lease. Everybody else watches; anyone may stop."""

from __future__ import annotations

from typing import Literal

Role = Literal["arms", "legs"]
ROLES: tuple[Role, ...] = ("arms", "legs")
"""Arms: wrists, hands, neck and waist. Legs: velocity, height and lean. Arrays with an entry a role have this order."""
SILENCE = 2.0
"""A driver who says nothing for this long loses the lease [s]."""


class Lease:
    """The right to write one role's part of the command. Times are monotonic [s]."""

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
            self.give(client, now)
        if client != self.holder:
            return False
        self._heard = now
        return True

    def give(self, client: str, now: float) -> None:
        """From here on it is this client's."""
        self.holder, self.number, self._heard = client, self.number + 1, now

    def leave(self, client: str) -> bool:
        """A client is gone, or wants the role no longer. Returns whether it was the one who drove."""
        drove = client == self.holder
        if drove:
            self.holder = None
        return drove

    def expire(self, now: float) -> bool:
        """Free the lease of a driver who fell silent. Returns whether there was one."""
        expired = self.holder is not None and now - self._heard > SILENCE
        if expired:
            self.holder = None
        return expired
