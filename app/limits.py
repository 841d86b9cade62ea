"""How much one client may send."""

from __future__ import annotations

import time

from starlette.datastructures import Headers
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Receive, Scope, Send

LARGEST_MESSAGE = 64 * 1024
"""Bytes of one WebSocket message, on any route."""
LARGEST_BODY = 1024 * 1024
"""Bytes of the body of one request."""
MESSAGES_A_SECOND = 200
"""A client who sends more over a socket is closed."""


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


class SmallBodies:
    """ASGI middleware: refuses a body of more than LARGEST_BODY bytes before a byte of it is read."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on what tells a length that is small enough; the HTTP parser lets no body be longer than it tells."""
        headers = Headers(scope=scope) if scope["type"] == "http" else Headers()
        length = headers.get("content-length", "0")
        if "transfer-encoding" in headers:
            await PlainTextResponse("tell the length of the body\n", 411)(scope, receive, send)
        elif not length.isdecimal() or int(length) > LARGEST_BODY:
            await PlainTextResponse(f"a body has at most {LARGEST_BODY} bytes\n", 413)(scope, receive, send)
        else:
            await self._app(scope, receive, send)
