"""Errors of this folder, each naming the way out."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from policies.errors import PolicyError


class NoClips(PolicyError):
    """Nothing to learn from, or to judge by."""

    def __init__(self, what: str) -> None:
        super().__init__(f"{what}; give --clips FILE (of `teleop-train retarget`), --synthetic FILE (of `teleop-train synthetic`) or both")


class OtherTraining(PolicyError):
    """A training that would go on otherwise than it began."""

    def __init__(self, run: Path, changed: Iterable[str]) -> None:
        super().__init__(f"{run} was begun with another {', '.join(changed)}; give the same again, or another --run")
