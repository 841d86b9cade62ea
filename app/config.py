"""What the program is started with."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.log import Form


@dataclass(frozen=True)
class Serve:
    """Serve the page from which the robot is driven."""

    robot: str = "h1"
    """Which robot."""
    host: str = "127.0.0.1"
    """Address to listen on. Other machines reach it through an SSH tunnel, or here with a token."""
    port: int = 8080
    """Port to listen on."""
    token: Path | None = None
    """File of the token that everybody needs who opens the page; made where there is none."""
    names: tuple[str, ...] = ()
    """Further names under which the page is opened, such as lab-pc.local."""
    certificate: Path | None = None
    """TLS certificate (PEM); headsets only show the robot over https."""
    key: Path | None = None
    """Private key of the certificate (PEM)."""
    self_signed: bool = False
    """Serve over https with a certificate of one's own, made once; a headset has to be told to trust it (docs/headset.md)."""
    policy: str = "walk_h1"
    """Weights of the leg policy: a shipped name, or a path to a .safetensors file."""
    sources: tuple[str, ...] = ()
    """Commands from this program, beside the page's: circle (the right wrist goes round), replay:FILE (a recorded operator)."""
    log: Form = "text"
    """Warnings as text, or every event as a line of JSON."""
    recordings: Path = Path("recordings")
    """Folder of the recorded episodes."""
