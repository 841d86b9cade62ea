"""How much one client may send and leave unread, and how it is told."""

from __future__ import annotations

import time

LARGEST_MESSAGE = 64 * 1024
"""Bytes of one WebSocket message, on any route."""
LARGEST_BODY = 1024 * 1024
"""Bytes of the body of one request."""
MESSAGES_A_SECOND = 200
"""A client who sends more over a socket is closed."""
CLIENTS = 16
"""Open sockets of a kind."""
BLOCKED = 5.0
"""A client that takes in nothing for this long is closed [s]."""

NOT_TEXT, NOT_JSON, TOO_MANY, TOO_BIG, GONE, FULL = 1003, 1007, 1008, 1009, 1011, 1013
"""Why a socket is closed."""


class TooMany(Exception):
    """A client sends faster than it may."""

    def __init__(self) -> None:
        super().__init__(f"more than {MESSAGES_A_SECOND} messages a second")


class Allowance:
    """So many messages a second, with a second's worth at once."""

    def __init__(self, rate: float = MESSAGES_A_SECOND) -> None:
        self._rate, self._left, self._at = rate, rate, time.monotonic()

    def take(self) -> None:
        """One more.

        Raises:
            TooMany: there is none left.
        """
        now = time.monotonic()
        self._left = min(self._rate, self._left + (now - self._at) * self._rate)
        self._at = now
        if self._left < 1:
            raise TooMany
        self._left -= 1
