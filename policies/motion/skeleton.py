"""Finds the joints of a human skeleton by their names, whichever convention a BVH file follows."""

from __future__ import annotations

import re
from dataclasses import dataclass

from policies.motion.bvh import Bvh

# part -> names it goes by, without side and separators, lower case (CMU in two conversions, ACCAD, Mixamo, ASF, plain English)
_NAMES = {
    "upper_arm": ("arm", "shldr", "uparm", "upperarm", "humerus"),
    "forearm": ("forearm", "lowarm", "lowerarm", "radius", "elbow"),
    "hand": ("fingerbase", "hand", "wrist"),  # CMU's LeftHand only twists the forearm; its palm is LeftFingerBase, at the same place
    "thigh": ("upleg", "thigh", "upperleg", "femur"),
    "shin": ("leg", "shin", "lowleg", "lowerleg", "tibia", "knee"),
    "foot": ("foot", "ankle"),
}


class MissingJoints(Exception):
    """A skeleton without joints that retargeting needs."""

    def __init__(self, missing: list[str], found: tuple[str, ...]) -> None:
        listed = ", ".join(found[:40])
        super().__init__(f"no joint found for {', '.join(missing)}; the file's joints are: {listed}")


@dataclass(frozen=True)
class Parts:
    """Joint indices of a skeleton; pairs are (left, right)."""

    upper_arm: tuple[int, int]
    forearm: tuple[int, int]
    hand: tuple[int, int]
    thigh: tuple[int, int]
    shin: tuple[int, int]
    foot: tuple[int, int]
    thumb: tuple[int, int] | None
    """First thumb joints, where the file has them."""
    chest: int
    """The joint that both arms hang from."""
    pelvis: int
    """The joint that both legs hang from."""


def find(skeleton: Bvh) -> Parts:
    """The parts of a skeleton.

    Raises:
        MissingJoints: an arm or a leg is not all there under a known name.
    """
    plain = [_plain(name) for name in skeleton.names]
    pairs: dict[str, tuple[int, int]] = {}
    missing: list[str] = []
    for part, names in _NAMES.items():
        found = [_index(plain, side, names) for side in ("left", "right")]
        missing += [f"{side} {part.replace('_', ' ')}" for side, at in zip(("left", "right"), found, strict=True) if at is None]
        pairs[part] = (found[0] or 0, found[1] or 0)
    if missing:
        raise MissingJoints(missing, skeleton.names)
    left, right = (_index(plain, side, ("thumb", "thumb1", "handthumb1")) for side in ("left", "right"))
    thumb = (left, right) if left is not None and right is not None else None
    return Parts(**pairs, thumb=thumb, chest=_meet(skeleton, *pairs["upper_arm"]), pelvis=_meet(skeleton, *pairs["thigh"]))


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.split(":")[-1].lower())


def _index(plain: list[str], side: str, names: tuple[str, ...]) -> int | None:
    for name in names:
        for spelling in (side + name, side[0] + name, name + side, name + side[0]):
            if spelling in plain:
                return plain.index(spelling)
    return None


def _meet(skeleton: Bvh, one: int, other: int) -> int:
    above = _ancestors(skeleton, one)
    return next(joint for joint in _ancestors(skeleton, other) if joint in above)


def _ancestors(skeleton: Bvh, joint: int) -> list[int]:
    chain = [joint]
    while skeleton.parents[chain[-1]] >= 0:
        chain.append(skeleton.parents[chain[-1]])
    return chain
