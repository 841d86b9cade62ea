"""`teleop-bench hands`: how well a robot hand follows a recorded human one."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from policies.commit import commit
from policies.errors import UnreadableHand
from policies.hand_model import FINGERS
from policies.hands import JOINTS, TIPS, HandRetargeter
from robots import catalog

SIDES = ("left", "right")


@dataclass(frozen=True)
class HandsBench:
    """Retarget a sequence of human hands to both hands of a robot (mirrored for the other one).

    Example: teleop-bench hands --sequence hand.npy
    """

    sequence: Path
    """A .npy file of hands [frames, 21, 3] in metres: wrist, then four joints a finger from base to tip, thumb first."""
    side: str = "right"
    """Which hand it shows."""
    rate: float = 60.0
    """Frames a second."""
    pinch: float = 0.035
    """Thumb and a finger pinch when their tips, scaled to the robot's hand, are closer than this [m]."""
    robot: str = "h1"
    """Name in the catalog."""
    json: Path | None = None
    """Also write the figures to this file."""


def run(config: HandsBench) -> dict:
    """Measure, print a table, return the JSON record.

    Raises:
        UnreadableHand: the file holds no hands.
    """
    hands = _load(config.sequence)
    robot = catalog.load(config.robot)
    model = robot.model("play")
    record: dict = {"frames": len(hands), "commit": commit()}
    for side, name in enumerate(SIDES):
        joints = hands if name == config.side else hands * np.array([1.0, -1.0, 1.0])
        record[name] = measure(HandRetargeter(robot.spec, model, side), joints, config.rate, config.pinch)
    table = Table(title=f"{len(hands)} hands")
    for column in ("", *SIDES):
        table.add_column(column, justify="right")
    for row in record["left"]:
        table.add_row(row.replace("_", " "), *(_shown(record[side][row]) for side in SIDES))
    Console().print(table)
    if config.json:
        config.json.write_text(json.dumps(record, indent=1) + "\n")
    return record


def measure(retargeter: HandRetargeter, hands: np.ndarray, rate: float, pinch: float) -> dict:
    """Figures of one hand over human hands [n, 21, 3]. Times are processor time."""
    took, drives, errors, possible = [], [], {finger: [] for finger in FINGERS[1:]}, {finger: [] for finger in FINGERS[1:]}
    for joints in hands:
        began = time.thread_time()
        drives.append(retargeter.solve(joints, 1 / rate))
        took.append(1e3 * (time.thread_time() - began))
        wanted = retargeter.scale(joints) * np.linalg.norm(joints[TIPS[1:]] - joints[TIPS[0]], axis=1)
        tips = retargeter.tips()
        nearest = int(wanted.argmin())
        if wanted[nearest] < pinch:
            gap, least = float(np.linalg.norm(tips[1 + nearest] - tips[0])), retargeter.touches[nearest][1]
            errors[FINGERS[1 + nearest]].append(1e3 * abs(gap - wanted[nearest]))
            possible[FINGERS[1 + nearest]].append(1e3 * least)
    figures: dict = {"ms_p50": float(np.median(took)), "ms_p99": float(np.percentile(took, 99))}
    figures |= {"lowest_drive": float(np.min(drives)), "highest_drive": float(np.max(drives))}
    for finger, found in errors.items():
        figures[f"{finger}_pinches"] = len(found)
        figures[f"{finger}_error_mm_max"] = max(found, default=0.0)
        figures[f"{finger}_within_10_mm"] = float(np.mean(np.array(found) <= 10)) if found else 1.0
        figures[f"{finger}_smallest_gap_mm"] = max(possible[finger], default=0.0)
    return figures


def _load(path: Path) -> np.ndarray:
    try:
        hands = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise UnreadableHand(path, str(error)) from error
    if hands.ndim != 3 or hands.shape[1:] != (JOINTS, 3) or not len(hands):
        raise UnreadableHand(path, f"its array has the shape {hands.shape}, not [frames, {JOINTS}, 3]")
    return hands.astype(float)


def _shown(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)
