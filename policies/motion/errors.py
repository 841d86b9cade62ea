"""Errors of this folder, each naming the file and the way out."""

from __future__ import annotations

from pathlib import Path


class MotionError(Exception):
    """A motion file or a store of clips that cannot be used."""


class UnreadableMotion(MotionError):
    """A motion file that is damaged or lacks what retargeting needs."""

    def __init__(self, path: Path, reason: str) -> None:
        super().__init__(f"{path.name}: {reason}")
        self.reason = reason
