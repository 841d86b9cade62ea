"""What the messages of a recording look like: events, exact rows, and a light view of the rows for plotting tools."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
from mcap.writer import Writer

from policies.command import AT
from policies.episode import MODES, STAGES, Metadata
from robots.state import State

EVENTS, ROWS, PLOT = 1, 2, 3
"""Channel ids. They are fixed, so that a chunk can be read when the one that declares them is lost.
Every message carries the number of its episode as its MCAP sequence number, for the same reason."""

PLOT_EVERY = 5
"""A plot message every so many ticks: 10 Hz."""

_NUMBER = {"type": ["number", "null"]}


def _group(*names: str) -> dict[str, Any]:
    return {"type": "object", "properties": dict.fromkeys(names, _NUMBER)}


_POSE = {"type": "object", "properties": {"position": _group("x", "y", "z"), "quaternion": _group("w", "x", "y", "z")}}
_ASKED = _group("vx", "vy", "yaw_rate", "height", "roll", "pitch")
_PLOT_SCHEMA = {
    "type": "object",
    "properties": {
        "time": _NUMBER,
        "mode": {"type": "string"},
        "reason": {"type": "string"},
        "base": _group("x", "y", "z", "yaw", "roll", "pitch", "vx", "vy", "yaw_rate"),
        "command": _ASKED,
        "applied": _ASKED,
        "wrists": {"type": "object", "properties": {"left": _POSE, "right": _POSE}},
        "latency_ms": _group(*STAGES),
    },
}
_EVENT_SCHEMA = {
    "type": "object",
    "properties": {"event": {"enum": ["start", "stop", "label", "discard", "gap"]}, "id": {"type": "string"}},
    "required": ["event"],
}


def declare(writer: Writer, metadata: Metadata) -> None:
    """Register schemas and channels in an opened file, in the order of their ids."""
    layout = json.dumps(metadata.dtype.descr).encode()
    for topic, encoding, name, schema_encoding, schema in (
        ("/episode", "json", "teleop.Event", "jsonschema", json.dumps(_EVENT_SCHEMA).encode()),
        ("/row", "x-numpy-record", "teleop.Row", "x-numpy-descr", layout),
        ("/robot", "json", "teleop.Robot", "jsonschema", json.dumps(_PLOT_SCHEMA).encode()),
    ):
        writer.register_channel(topic, encoding, writer.register_schema(name, schema_encoding, schema))


def plot_message(row: np.void, metadata: Metadata) -> bytes:
    """What a plotting tool shows of one row, as JSON; a number that is not finite becomes null."""
    applied, reason = row["applied"], int(row["reason"])
    left, right = applied[AT["wrists"]].reshape(2, 7)
    message = {
        "time": _number(row["time"]),
        "mode": MODES[row["mode"]] if row["mode"] < len(MODES) else str(row["mode"]),
        "reason": metadata.reasons[reason] if reason < len(metadata.reasons) else str(reason),
        "base": _base(row["state"], metadata),
        "command": _asked(row["raw"]),
        "applied": _asked(applied),
        "wrists": {"left": _pose(left), "right": _pose(right)},
        "latency_ms": _named(STAGES, row["latency"]),
    }
    return json.dumps(message).encode()


def _number(value: float) -> float | None:
    return round(float(value), 6) if math.isfinite(value) else None


def _named(names: tuple[str, ...], values: np.ndarray) -> dict[str, float | None]:
    return {name: _number(value) for name, value in zip(names, values, strict=True)}


def _asked(vector: np.ndarray) -> dict[str, float | None]:
    return _named(("vx", "vy", "yaw_rate", "height", "roll", "pitch"), vector[AT["twist"].start : AT["pitch"].stop])


def _pose(pose: np.ndarray) -> dict[str, dict[str, float | None]]:
    return {"position": _named(("x", "y", "z"), pose[:3]), "quaternion": _named(("w", "x", "y", "z"), pose[3:])}


def _base(state: np.ndarray, metadata: Metadata) -> dict[str, float | None]:
    qpos, qvel = state[1 : 1 + metadata.nq], state[1 + metadata.nq :][: metadata.nv]
    none = np.empty(0)
    base = State(
        time=state[0], position=qpos[:3], quaternion=qpos[3:7], velocity=qvel[:3], gyro=qvel[3:6],
        q=none, dq=none, feet=none, feet_velocity=none, touch=none,
    )  # fmt: skip
    with np.errstate(all="ignore"):  # a diverged simulation is recorded too
        values = np.concatenate([base.position, [base.yaw], base.roll_pitch, base.heading_velocity, [base.yaw_rate]])
    return _named(("x", "y", "z", "yaw", "roll", "pitch", "vx", "vy", "yaw_rate"), values)
