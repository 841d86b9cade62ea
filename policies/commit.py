"""Which commit a figure, weights or a recording belong to."""

from __future__ import annotations

import subprocess
from functools import cache
from pathlib import Path

CHECKOUT = Path(__file__).parents[1]
"""Where the program lies; a repository further up is somebody else's."""


@cache
def commit() -> str:
    """Short hash of the checkout when this was first asked, "-dirty" if changed; "unknown" without a checkout, or without git."""
    if not (CHECKOUT / ".git").exists():
        return "unknown"
    asked = ["git", "describe", "--always", "--dirty", "--exclude", "*"]
    try:
        return subprocess.run(asked, cwd=CHECKOUT, capture_output=True, text=True, timeout=10, check=True).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return "unknown"
