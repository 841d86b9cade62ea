"""What the program is started with."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Serve:
    """Serve the page from which the robot is driven."""

    robot: str = "h1"
    """Which robot."""
    host: str = "127.0.0.1"
    """Address to listen on. Other machines reach it through an SSH tunnel."""
    port: int = 8080
    """Port to listen on."""
    policy: str = "walk_h1"
    """Weights of the leg policy: a shipped name, or a path to a .safetensors file."""
    recordings: Path = Path("recordings")
    """Folder of the recorded episodes."""
