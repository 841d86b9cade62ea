"""What one watching page costs the web process, and how much it is sent."""

from __future__ import annotations

import asyncio
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager

from bench.page import watch

CLIENTS = (0, 1, 4)
"""Pages that watch at once."""
SETTLE, MEASURE = 3.0, 5.0
"""Seconds before and while measuring; the scene itself is sent first."""


@contextmanager
def server(policy: str) -> Iterator[tuple[str, int]]:
    """A `teleop` of its own on a free port: (address, process id)."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "app", "--port", "0", "--policy", policy, "--recordings", folder]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        try:
            assert process.stdout
            found = re.search(r"http://([\d.:]+)", process.stdout.readline())
            if not found:
                raise RuntimeError("the server did not start; run `teleop` to see why")
            yield found[1], process.pid
        finally:
            process.terminate()
            process.wait(20)


def measure(policy: str) -> dict[str, dict[str, float]]:
    """Clients -> share of one core that the web process takes, and kilobytes a second for each client."""
    with server(policy) as (address, pid):
        return {str(count): asyncio.run(_watched(address, pid, count)) for count in CLIENTS}


async def _watched(address: str, pid: int, count: int) -> dict[str, float]:
    sizes: list[int] = []
    pages = [asyncio.create_task(watch(address, sizes.append)) for _ in range(count)]
    await asyncio.sleep(SETTLE)
    sizes.clear()
    before, began = _cpu_seconds(pid), time.monotonic()
    await asyncio.sleep(MEASURE)
    seconds = time.monotonic() - began
    each = sum(sizes) / 1e3 / seconds / max(count, 1)
    figures = {"core_share": (_cpu_seconds(pid) - before) / seconds, "kilobytes_a_second": each}
    for page in pages:
        page.cancel()
    await asyncio.gather(*pages, return_exceptions=True)
    return figures


def _cpu_seconds(pid: int) -> float:
    """Processor time of one process, without its children [s]."""
    with open(f"/proc/{pid}/stat") as file:
        fields = file.read().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
