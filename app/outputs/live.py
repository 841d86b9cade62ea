"""Tells pages how the robot stands, each as fast as it can draw and never faster.

A page asks for the next qpos when it has shown the last one. So nothing queues up anywhere between the robot and a slow page,
and a hidden page costs nothing.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import numpy as np
from fastapi import APIRouter, WebSocket

from app import clock
from app.outputs.description import SceneDescription
from app.race import first_to_end
from app.traffic import BLOCKED, CLIENTS, FULL, NOT_TEXT, TOO_MANY, Allowance, TooMany

POLL = 0.005
"""How often a page that waits is looked after [s]; the simulation ticks every 0.02."""


def router(description: SceneDescription, newest: Callable[[], np.void]) -> APIRouter:
    """GET /api/scene and WS /api/scene.

    Args:
        description: of the scene whose robot moves.
        newest: the newest snapshot (app.shared.snapshot_dtype).
    """
    api = APIRouter(tags=["picture"])
    pages: set[WebSocket] = set()

    @api.get("/api/scene")
    def scene() -> SceneDescription:
        """What a page needs to move its picture of the robot."""
        return description

    @api.websocket("/api/scene")
    async def live(socket: WebSocket) -> None:
        """Any text asks for one frame newer than the last one: see app.outputs.live.frame."""
        await socket.accept()
        if len(pages) >= CLIENTS:
            await socket.close(FULL, f"{CLIENTS} pages are open already")
            return
        pages.add(socket)
        asked = asyncio.Semaphore(0)
        try:
            await first_to_end(_read(socket, asked), _show(socket, asked, newest))
        finally:
            pages.discard(socket)

    return api


def frame(snapshot: np.void) -> bytes:
    """What a page is sent, little-endian: number of the tick (uint32), age when it was sent [ms] (float32), qpos [nq] (float32)."""
    age = (clock.nanoseconds() - int(snapshot["stamp"])) * 1e-6
    head = np.array([(snapshot["tick"] % 2**32, age)], dtype=[("tick", "<u4"), ("age", "<f4")])
    return head.tobytes() + snapshot["qpos"].astype("<f4").tobytes()


async def _read(socket: WebSocket, asked: asyncio.Semaphore) -> None:
    """Every request until the socket closes, or has to be closed."""
    allowance = Allowance()
    try:
        while (packet := await socket.receive())["type"] != "websocket.disconnect":
            allowance.take()
            if packet.get("text") is None:
                await socket.close(NOT_TEXT, "a page asks for a frame by any text")
                return
            asked.release()
    except TooMany as error:
        await socket.close(TOO_MANY, str(error))


async def _show(socket: WebSocket, asked: asyncio.Semaphore, newest: Callable[[], np.void]) -> None:
    """One newest qpos for each request."""
    shown = None
    while True:
        await asked.acquire()
        while (snapshot := newest())["stamp"] == shown:
            await asyncio.sleep(POLL)
        shown = snapshot["stamp"]
        await asyncio.wait_for(socket.send_bytes(frame(snapshot)), BLOCKED)
