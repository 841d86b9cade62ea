"""Errors of this folder, each naming the file and the way out."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path

from policies.errors import PolicyError

NAMED = 24
"""So many clips are named; a store may hold thousands."""


class MotionError(PolicyError):
    """A motion file or a store of clips that cannot be used."""


class UnreadableMotion(MotionError):
    """A motion file that is damaged or lacks what retargeting needs."""

    def __init__(self, path: Path, reason: str) -> None:
        super().__init__(f"{path.name}: {reason}")
        self.reason = reason


class UnknownClip(MotionError):
    """A name that no clip of a store has."""

    def __init__(self, name: str, store: Path, known: Sequence[str]) -> None:
        alike = get_close_matches(name, known, n=NAMED, cutoff=0.4)
        named = [*alike, *(clip for clip in known if clip not in alike)][:NAMED]
        more = f" and {len(known) - len(named)} more" if len(known) > len(named) else ""
        super().__init__(f"there is no clip named {name!r} in {store}, and no such file; known clips: {', '.join(named)}{more}")
