"""Hands on the newest of what comes in, never a backlog."""

from __future__ import annotations

import asyncio
from typing import Generic, TypeVar

T = TypeVar("T")


class Newest(Generic[T]):
    """A place for one value. A newer one replaces it."""

    def __init__(self) -> None:
        self._there = asyncio.Event()
        self._value: T
        self.replaced = 0
        """Values that nobody took."""

    def put(self, value: T) -> None:
        """This is the newest."""
        self.replaced += self._there.is_set()
        self._value = value
        self._there.set()

    async def take(self) -> T:
        """The newest value, once there is one that was not taken yet."""
        await self._there.wait()
        self._there.clear()
        return self._value
