"""A network that misbehaves: between a client and the program it delays, cuts and swallows."""

from __future__ import annotations

import asyncio
import threading
from types import TracebackType

from stand_ins import eventually


class Proxy:
    """Passes TCP connections on to a port of this machine. Change its attributes at any time."""

    def __init__(self, target: int) -> None:
        self.delay = 0.0
        """How much later everything arrives [s]."""
        self.blackhole = False
        """Swallow everything, in both directions, without a word."""
        self.port = 0
        self._target = target
        self._open: set[asyncio.StreamWriter] = set()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()), daemon=True)

    def __enter__(self) -> Proxy:
        self._thread.start()
        eventually(lambda: self.port)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.cut()
        self._loop.call_soon_threadsafe(self._over.set)
        self._thread.join()

    def cut(self) -> None:
        """Reset every connection."""
        for writer in list(self._open):
            self._loop.call_soon_threadsafe(writer.transport.abort)

    async def _serve(self) -> None:
        self._loop, self._over = asyncio.get_running_loop(), asyncio.Event()
        server = await asyncio.start_server(self._connect, "127.0.0.1", 0)
        self.port = server.sockets[0].getsockname()[1]
        await self._over.wait()
        server.close()

    async def _connect(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        there_reader, there = await asyncio.open_connection("127.0.0.1", self._target)
        ends = {writer, there}
        self._open |= ends
        try:
            await asyncio.gather(self._pump(reader, there), self._pump(there_reader, writer))
        except OSError:
            pass
        finally:
            self._open -= ends
            for end in ends:
                end.close()

    async def _pump(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while data := await reader.read(65536):
            await asyncio.sleep(self.delay)
            if not self.blackhole:
                writer.write(data)
                await writer.drain()
        writer.close()
