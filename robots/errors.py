"""Errors of this folder, each built from facts and naming the way out."""

from __future__ import annotations

from collections.abc import Iterable


class RobotError(Exception):
    """Something about a robot that the person in front of it can mend."""


class UnknownRobot(RobotError):
    """A robot name that the catalog does not hold."""

    def __init__(self, name: str, known: Iterable[str]) -> None:
        super().__init__(f"there is no robot named {name!r}; known robots: {', '.join(sorted(known))}")


class PhysicsDiverged(RobotError):
    """MuJoCo warned, a number is no longer finite, or time did not advance."""
