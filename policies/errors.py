"""Errors of this folder, each built from facts and naming the way out."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path


class PolicyError(Exception):
    """Something about weights or policies that the person in front of it can mend."""


class UnknownPolicy(PolicyError):
    """A policy name for which there are no weights."""

    def __init__(self, name: str, known: Iterable[str]) -> None:
        super().__init__(
            f"there is no policy named {name!r}; known policies: {', '.join(sorted(known)) or 'none'}, or a path to a .safetensors file"
        )


class WrongWeights(PolicyError):
    """Weights that were trained for something else."""

    def __init__(self, path: Path, what: str, found: object, wanted: object) -> None:
        super().__init__(f"{path} was made for {what} {found!r}, not {wanted!r}; choose other weights or train them with `teleop-train`")


class DamagedWeights(PolicyError):
    """A weights file that cannot be read."""

    def __init__(self, path: Path, why: str) -> None:
        super().__init__(f"{path} cannot be read ({why}); restore it with `git checkout {path.name}` or train it again")


class OtherMotions(PolicyError):
    """A training that would go on with other motions than it began with."""

    def __init__(self, path: Path, found: int, given: int) -> None:
        super().__init__(f"{path} was trained with {found} motions, not {given}: give the same --motions and --reaches, or another --run")


class NothingToBeginWith(PolicyError):
    """A run to begin with that has no checkpoint."""

    def __init__(self, path: Path) -> None:
        super().__init__(f"there is no {path}: train it first with `teleop-train walk --run {path.parent}`")


class UnreadableHand(PolicyError):
    """A file that holds no human hands."""

    def __init__(self, path: Path, why: str) -> None:
        super().__init__(f"{path} cannot be read as hands ({why}); give a .npy file of an array [frames, 21, 3] in metres")
