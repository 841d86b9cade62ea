"""The page on our own port: viser's client with our overlay in it, and the socket that fills its scene."""

from __future__ import annotations

import asyncio
import gzip
from contextlib import suppress
from pathlib import Path

from fastapi import APIRouter, Request, Response, WebSocket, WebSocketDisconnect
from fastapi.responses import FileResponse
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.typing import Subprotocol

from app.errors import AppError
from app.race import first_to_end
from app.traffic import BLOCKED, CLIENTS, FULL, GONE, TOO_MANY, Allowance, TooMany

SLOWEST = 100_000
"""Bytes a second that a page must take in; a scene has about 3 MB."""

OVERLAY = (
    '<script src="/web/tap.js"></script><link rel="stylesheet" href="/web/page.css"><script type="module" src="/web/main.js"></script>'
)
KINDS = {".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml", ".html": "text/html"}
FRESH = {"Cache-Control": "no-cache", "X-Content-Type-Options": "nosniff"}
"""An updated program shows its own page, not the cached one."""
UNFRAMED = FRESH | {"X-Frame-Options": "DENY"}
"""No other site can lay the page under its own buttons."""


class BrokenPage(AppError):
    """The page cannot be put together."""


def page_router(viser_port: int, client: str) -> APIRouter:
    """The page at /, the headset's at /xr, their files below /web, and viser's socket at /.

    Args:
        viser_port: where viser listens on the loopback address.
        client: HTML of viser's client.

    Raises:
        BrokenPage: the client has no </head>, or the installation has no web files.
    """
    router = APIRouter(include_in_schema=False)
    page, files = with_overlay(client).encode(), web_files()
    packed = gzip.compress(page)
    pages: set[WebSocket] = set()

    @router.get("/")
    def index(request: Request) -> Response:
        packs = "gzip" in request.headers.get("accept-encoding", "")
        headers = UNFRAMED | ({"Content-Encoding": "gzip"} if packs else {})
        return Response(packed if packs else page, media_type="text/html", headers=headers)

    @router.get("/xr")
    def headset() -> Response:
        return FileResponse(files["headset.html"], media_type="text/html", headers=UNFRAMED)

    @router.get("/web/{name}")
    def file(name: str) -> Response:
        if name not in files:
            return Response("there is no such file\n", 404, media_type="text/plain")
        return FileResponse(files[name], media_type=KINDS[files[name].suffix], headers=FRESH)

    @router.websocket("/")
    async def relay(socket: WebSocket) -> None:
        protocols = [Subprotocol(name) for name in socket.scope["subprotocols"]]
        await socket.accept(subprotocol=protocols[0] if protocols else None)
        if len(pages) >= CLIENTS:
            await socket.close(FULL, f"{CLIENTS} pages are open already")
            return
        pages.add(socket)
        try:
            await _relay(socket, f"ws://127.0.0.1:{viser_port}", protocols)
        finally:
            pages.discard(socket)

    return router


def with_overlay(client: str) -> str:
    """viser's page with our scripts in its head, where they run before its own.

    Raises:
        BrokenPage: it has no </head>.
    """
    if "</head>" not in client:
        raise BrokenPage("viser's page has no </head>, so the controls cannot be put into it; reinstall viser")
    before, _, after = client.partition("</head>")
    return f"{before}{OVERLAY}</head>{after}"


def web_files() -> dict[str, Path]:
    """Name -> path of the files below /web: beside this file in an installed wheel, at the top of a checkout.

    Raises:
        BrokenPage: there are none.
    """
    here = Path(__file__).parent
    for folder in (here / "web", here.parent / "web"):
        found = {path.name: path for path in folder.glob("*") if path.suffix in KINDS}
        if "main.js" in found:
            return found
    raise BrokenPage("the page's files are missing from this installation; reinstall humanoid-teleop")


async def _relay(socket: WebSocket, address: str, protocols: list[Subprotocol]) -> None:
    """What viser sends goes to the page. What the page sends goes nowhere: whoever drives does so through /api/operator."""
    try:
        async with connect(address, subprotocols=protocols, compression=None, max_size=None, max_queue=1, proxy=None) as viser:
            await first_to_end(_forward(viser, socket), _ignore(socket))
    except (OSError, InvalidHandshake, ConnectionClosed):
        pass
    with suppress(WebSocketDisconnect, RuntimeError, TimeoutError):  # the page may have left, or may be what is blocked
        await asyncio.wait_for(socket.close(GONE), 1.0)


async def _forward(viser: ClientConnection, socket: WebSocket) -> None:
    before = 0  # bytes; sending waits until the page has taken in the message before
    with suppress(WebSocketDisconnect, ConnectionClosed, TimeoutError, RuntimeError):
        async for message in viser:
            assert isinstance(message, bytes)
            await asyncio.wait_for(socket.send_bytes(message), BLOCKED + before / SLOWEST)
            before = len(message)


async def _ignore(socket: WebSocket) -> None:
    allowance = Allowance()
    try:
        while (await socket.receive())["type"] != "websocket.disconnect":
            allowance.take()
    except TooMany as error:
        await socket.close(TOO_MANY, str(error))
