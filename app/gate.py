"""Who may talk to this server at all: pages that it served itself, under names that it goes by, to people who know its token.

A page of another site cannot open a socket here (its Origin differs from our Host), and a name that somebody points at
our address does not help it (that Host is not ours). The token, where there is one, comes once in the address of a page and
from then on in a cookie that no script reads and no other site sends; programs send it as `Authorization: Bearer TOKEN`.
"""

from __future__ import annotations

import html
import logging
import secrets
from collections.abc import Sequence
from urllib.parse import parse_qsl, urlencode, urlsplit

from starlette.datastructures import Headers
from starlette.requests import cookie_parser
from starlette.responses import HTMLResponse, PlainTextResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

_log = logging.getLogger(__name__)

LOOPBACK = frozenset({"localhost", "127.0.0.1", "::1"})
COOKIE = "teleop_token"
PAGES = ("/", "/xr")
"""Addresses at which the token may be given."""
WELCOME = '<!doctype html><title>humanoid-teleop</title><meta http-equiv="refresh" content="0; url={}?{}">'
"""Goes on to the page from an address of ours: a cookie that is strict would not travel with a redirect from another site's link."""
STRANGE = "this address only serves its own page, under names that it knows; teleop --names NAME adds one\n"
PRIVATE = {"Cache-Control": "no-store", "Referrer-Policy": "no-referrer"}


class Gate:
    """ASGI middleware for requests and sockets alike."""

    def __init__(self, app: ASGIApp, host: str, names: Sequence[str] = (), token: str | None = None) -> None:
        """Let in what is allowed.

        Args:
            app: what is behind the gate.
            host: the configured host name, allowed beside the loopback names and the address that a client reached.
            names: further names of this machine.
            token: what everybody has to know; None: whoever reaches the server is let in.
        """
        self._app, self._hosts = app, LOOPBACK | {host, *(name.lower() for name in names)}
        self._token = None if token is None else token.encode()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on what is allowed. Answer 403 to other sites and names, 401 to who does not know the token."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers, refused = Headers(scope=scope), None
        if not self.allows(headers, (scope.get("server") or ("",))[0]):
            refused = PlainTextResponse(STRANGE, 403)
        elif not self.knows(headers):
            refused = self._welcome(scope) or PlainTextResponse("open the address with the token that teleop printed\n", 401)
        if refused is None:
            await self._app(scope, receive, send)
            return
        if refused.status_code != 200:
            _log.info("refused", extra={"status": refused.status_code, "path": scope["path"], "client": (scope.get("client") or ("",))[0]})
        await refused(scope, receive, send)

    def allows(self, headers: Headers, reached: str = "") -> bool:
        """Whether Host is one of ours, and Origin, where a browser sends one, is that very address.

        Args:
            headers: of the request.
            reached: our own address at which it arrived: whoever names it cannot be a rebound name.
        """
        hosts, origins = headers.getlist("host"), headers.getlist("origin")
        if len(hosts) != 1 or len(origins) > 1 or _name(hosts[0]) not in {*self._hosts, reached}:
            return False
        return not origins or origins[0] in (f"http://{hosts[0]}", f"https://{hosts[0]}")

    def knows(self, headers: Headers) -> bool:
        """Whether the cookie or the Authorization header holds the token."""
        if self._token is None:
            return True
        kind, _, bearer = headers.get("authorization", "").partition(" ")
        cookie = cookie_parser(headers.get("cookie", "")).get(COOKIE, "")
        return self._is_token(bearer if kind.lower() == "bearer" else cookie)

    def _welcome(self, scope: Scope) -> Response | None:
        """The answer to a page's address with the token in it; None to any other."""
        query = dict(parse_qsl(scope["query_string"].decode("latin-1")))
        given = query.pop("token", "")
        if scope["type"] != "http" or scope["method"] != "GET" or scope["path"] not in PAGES or not self._is_token(given):
            return None
        answer = HTMLResponse(WELCOME.format(scope["path"], html.escape(urlencode(query))), headers=PRIVATE)
        answer.set_cookie(COOKIE, given, httponly=True, samesite="strict", secure=scope["scheme"] == "https", path="/")
        return answer

    def _is_token(self, given: str) -> bool:
        return self._token is not None and secrets.compare_digest(given.encode(), self._token)


def _name(host: str) -> str | None:
    try:
        return urlsplit(f"//{host}").hostname
    except ValueError:
        return None
