"""A page that watches, without a browser: it opens the sockets a page opens, takes everything in and draws nothing."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress

from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Origin, Subprotocol

FRAME = 1 / 60
"""Seconds a page takes to draw, after which it asks for the next pose."""


async def watch(address: str, taken: Callable[[int], None]) -> None:
    """Watch the server at host:port until cancelled; `taken` is told the bytes of every message."""
    import viser  # the scene's socket names its version

    origin, protocol = Origin(f"http://{address}"), Subprotocol(f"viser-v{viser.__version__}")

    async def read(path: str, protocols: list[Subprotocol] | None = None, ask: bool = False) -> None:
        with suppress(ConnectionClosed):
            async with connect(f"ws://{address}{path}", origin=origin, subprotocols=protocols, compression=None, max_size=None) as socket:
                while True:
                    if ask:
                        await asyncio.sleep(FRAME)
                        await socket.send("next")
                    taken(len(await socket.recv()))

    await asyncio.gather(read("/", [protocol]), read("/api/scene", ask=True), read("/api/operator"))
