"""viser, which draws in the page: started where only this program reaches it."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import viser
import viser.infra
import websockets.asyncio.server
from viser import _messages

from app.errors import AppError

VERSION = "1.1.1"
"""The overlay in web/ knows the messages of this version."""


class UnknownViewer(AppError):
    """A viser that the page was not made for."""


def start() -> viser.ViserServer:
    """A viser server on a free port of the loopback address.

    Its defaults trust everybody: any web site may connect, and any client may open a tunnel to the internet. Here no browser
    may connect (app.relay does, for the page), and the tunnel has no handler.

    Raises:
        UnknownViewer: another version of viser is installed.
    """
    if viser.__version__ != VERSION:
        raise UnknownViewer(f"the page needs viser {VERSION}, and viser {viser.__version__} is installed; pip install viser=={VERSION}")
    with _no_browsers(), _silence():  # it would print an address that nobody may open
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    for request in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
        server._websock_server.unregister_handler(request)
    return server


def stop(server: viser.ViserServer) -> None:
    """End it and its thread."""
    with _silence():
        server.stop()


def client_page() -> str:
    """The HTML of viser's own client, everything in one file."""
    return (Path(viser.__file__).parent / "client" / "build" / "index.html").read_text(encoding="utf-8")


def _silence() -> contextlib.AbstractContextManager:
    return contextlib.redirect_stdout(io.StringIO())


@contextlib.contextmanager
def _no_browsers() -> Iterator[None]:
    """Whoever starts a websockets server meanwhile refuses connections with an Origin, which every browser sends."""
    serve = websockets.asyncio.server.serve
    websockets.asyncio.server.serve = partial(serve, origins=[None])
    try:
        yield
    finally:
        websockets.asyncio.server.serve = serve
