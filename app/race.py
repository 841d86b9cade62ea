"""Runs both directions of a socket together."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from contextlib import suppress

from fastapi import WebSocketDisconnect


async def first_to_end(*coroutines: Awaitable[None]) -> None:
    """Run them together; the end of one ends the others. A closed socket is a normal end."""
    tasks = [asyncio.ensure_future(c) for c in coroutines]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    with suppress(WebSocketDisconnect, RuntimeError, TimeoutError):
        for task in done:
            task.result()
