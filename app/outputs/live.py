"""Tells pages how the robot stands, each as fast as it can draw and never faster.

A page asks for the next qpos when it has shown the last one. So nothing queues up anywhere between the robot and a slow page,
and a hidden page costs nothing.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress

import numpy as np
from fastapi import APIRouter, WebSocket, WebSocketDisconnect

from app import clock
from app.outputs.description import SceneDescription

CLIENTS = 16
"""Pages that are shown the robot."""
FULL = 1013
"""Why a socket is closed."""
POLL = 0.005
"""How often a page that waits is looked after [s]; the simulation ticks every 0.02."""
STANDSTILL = 1.0
"""A page is told the same qpos again after this long, so that a page that left is noticed [s]."""
BLOCKED = 5.0
"""A page that takes in nothing for this long is closed [s]."""


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
        try:
            with suppress(WebSocketDisconnect, TimeoutError, RuntimeError):
                await _serve(socket, newest)
        finally:
            pages.discard(socket)

    return api


def frame(snapshot: np.void) -> bytes:
    """What a page is sent, little-endian: number of the tick (uint32), age when it was sent [ms] (float32), qpos [nq] (float32)."""
    age = (clock.nanoseconds() - int(snapshot["stamp"])) * 1e-6
    head = np.array([(snapshot["tick"] % 2**32, age)], dtype=[("tick", "<u4"), ("age", "<f4")])
    return head.tobytes() + snapshot["qpos"].astype("<f4").tobytes()


async def _serve(socket: WebSocket, newest: Callable[[], np.void]) -> None:
    """One newest qpos for each request, until the socket closes."""
    shown = None
    while True:
        await socket.receive_text()
        waits = clock.now()
        while (snapshot := newest())["stamp"] == shown and clock.now() - waits < STANDSTILL:
            await asyncio.sleep(POLL)
        shown = snapshot["stamp"]
        await asyncio.wait_for(socket.send_bytes(frame(snapshot)), BLOCKED)
