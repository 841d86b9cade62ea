"""Who may talk to this server at all: pages that it served itself, under names that it goes by.

A page of another site cannot open a socket here (its Origin differs from our Host), and a name that somebody points at
127.0.0.1 does not help it (that Host is not ours).
"""

from __future__ import annotations

from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Receive, Scope, Send

LOOPBACK = frozenset({"localhost", "127.0.0.1", "::1"})


class Gate:
    """ASGI middleware for requests and sockets alike."""

    def __init__(self, app: ASGIApp, host: str) -> None:
        """`host` is the configured one, allowed beside the loopback names."""
        self._app, self._hosts = app, LOOPBACK | {host}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on what is allowed; answer anything else with 403."""
        if scope["type"] not in ("http", "websocket") or self.allows(Headers(scope=scope)):
            await self._app(scope, receive, send)
        elif scope["type"] == "http":
            await PlainTextResponse("this address only serves its own page\n", status_code=403)(scope, receive, send)
        else:
            await send({"type": "websocket.close", "code": 1008})

    def allows(self, headers: Headers) -> bool:
        """Whether Host is one of ours, and Origin, where a browser sends one, is that very address."""
        hosts, origins = headers.getlist("host"), headers.getlist("origin")
        if len(hosts) != 1 or len(origins) > 1 or _name(hosts[0]) not in self._hosts:
            return False
        return not origins or origins[0] in (f"http://{hosts[0]}", f"https://{hosts[0]}")


def _name(host: str) -> str | None:
    try:
        return urlsplit(f"//{host}").hostname
    except ValueError:
        return None
