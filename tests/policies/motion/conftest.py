"""A hand-made skeleton written as BVH files."""

import gzip
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

# name, parent, offset in a T-pose with y up, z forward, x left; units are a tenth of a leg
SKELETON = (
    ("Hips", None, (0, 0, 0)),
    ("Spine", "Hips", (0, 2, 0)),
    ("Neck", "Spine", (0, 4, 0)),
    ("LeftArm", "Spine", (2, 3, 0)),
    ("LeftForeArm", "LeftArm", (3, 0, 0)),
    ("LeftHand", "LeftForeArm", (2, 0, 0)),
    ("RightArm", "Spine", (-2, 3, 0)),
    ("RightForeArm", "RightArm", (-3, 0, 0)),
    ("RightHand", "RightForeArm", (-2, 0, 0)),
    ("LeftUpLeg", "Hips", (1, 0, 0)),
    ("LeftLeg", "LeftUpLeg", (0, -5, 0)),
    ("LeftFoot", "LeftLeg", (0, -5, 0)),
    ("RightUpLeg", "Hips", (-1, 0, 0)),
    ("RightLeg", "RightUpLeg", (0, -5, 0)),
    ("RightFoot", "RightLeg", (0, -5, 0)),
)


def write_bvh(
    path: Path, turns: dict[str, tuple[np.ndarray, int]], frames: int = 60, root: np.ndarray | None = None, rename: str = ""
) -> Path:
    """A BVH file at 60 Hz. turns: joint -> (angles [frames] in degrees, axis 0 x, 1 y, 2 z), one axis a joint."""
    lines = ["HIERARCHY"]

    def add(name: str, depth: int) -> None:
        offset = next(o for n, _, o in SKELETON if n == name)
        channels = "6 Xposition Yposition Zposition" if depth == 0 else "3"
        lines.extend([f"{'ROOT' if depth == 0 else 'JOINT'} {rename}{name}", "{", "OFFSET {} {} {}".format(*offset)])
        lines.append(f"CHANNELS {channels} Zrotation Xrotation Yrotation")
        children = [n for n, parent, _ in SKELETON if parent == name]
        for child in children:
            add(child, depth + 1)
        if not children:
            lines.extend(["End Site", "{", "OFFSET 0 0 0", "}"])
        lines.append("}")

    add("Hips", 0)
    order = [line.split()[1].removeprefix(rename) for line in lines if line.startswith(("ROOT", "JOINT"))]
    columns = [np.zeros((frames, 3)) if root is None else root]
    for name in order:
        angles = np.zeros((frames, 3))
        if name in turns:
            angles[:, (1, 2, 0)[turns[name][1]]] = turns[name][0]
        columns.append(angles)
    rows = np.concatenate(columns, axis=1)
    lines += ["MOTION", f"Frames: {frames}", "Frame Time: 0.0166667"]
    lines += [" ".join(f"{x:.6f}" for x in row) for row in rows]
    text = "\n".join(lines) + "\n"
    path.write_bytes(gzip.compress(text.encode()) if path.suffix == ".gz" else text.encode())
    return path


def hanging_with_bent_elbows(path: Path, bend: np.ndarray, **more) -> Path:
    """Upper arms along the body, forearms bent forward by `bend` degrees."""
    down = np.full(len(bend), 90.0)
    turns = {"LeftArm": (-down, 2), "RightArm": (down, 2), "LeftForeArm": (-bend, 1), "RightForeArm": (bend, 1)}
    return write_bvh(path, turns, frames=len(bend), **more)


@pytest.fixture
def write() -> Callable[..., Path]:
    return write_bvh


@pytest.fixture
def hanging() -> Callable[..., Path]:
    return hanging_with_bent_elbows
