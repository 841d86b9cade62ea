"""What a recording holds: one row a tick, episodes, and what made them. `policies.recording` puts them on disk."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from policies.command import COMMAND_LAYOUT, SIZE

FORMAT = 2
"""Version of the file layout. A reader refuses another one instead of guessing."""

STAGES = ("queue", "ik", "policy", "physics", "publish", "lateness")
"""What the `latency` field of a row measures, in this order [ms]."""

MODES = ("STOPPED", "HOLD", "ENGAGED", "FAULT")
"""What the `mode` field of a row means, by its value."""

Ending = Literal["open", "stopped", "closed", "truncated"]
"""open: still recording. stopped: the operator stopped it. closed: the program ended. truncated: a crash or a full disk ended it."""


class DamagedRecording(Exception):
    """A recording that cannot be read, or not by this program."""

    def __init__(self, path: Path, reason: str, way_out: str) -> None:
        super().__init__(f"{path}: {reason}; {way_out}")
        self.path = path


def row_dtype(nu: int, nstate: int, nobs: int, nlatent: int, naction: int) -> np.dtype:
    """One tick as a packed little-endian record: what the simulation knew and did.

    Args:
        nu: motors of the stepped model.
        nstate: numbers of MuJoCo's mjSTATE_INTEGRATION.
        nobs: numbers of the leg policy's observation.
        nlatent: numbers of the motion prior's latent.
        naction: numbers of the leg policy's action.
    """
    return np.dtype(
        [
            ("tick", "<u8"),  # counts ticks since the simulation started; a missing number is a lost row
            ("time", "<f8"),  # simulated time before the step [s]
            ("wall", "<f8"),  # unix time [s]
            ("state", "<f8", (nstate,)),  # mjSTATE_INTEGRATION before the step
            ("ctrl", "<f8", (nu,)),  # motor targets of this tick [rad]
            ("raw", "<f8", (SIZE,)),  # Command.vector as received
            ("applied", "<f8", (SIZE,)),  # Command.vector after the guard
            ("observation", "<f4", (nobs,)),
            ("latent", "<f4", (nlatent,)),
            ("action", "<f4", (naction,)),
            ("latency", "<f4", (len(STAGES),)),  # ms, see STAGES
            ("mode", "u1"),  # index into MODES
            ("jump", "u1"),  # 1: the state was set from outside before this tick (reset or restore)
            ("reason", "u1"),  # why the mode is what it is; index into Metadata.reasons
            ("policy", "u1"),  # which leg weights walked; index into Metadata.policies
        ]
    )


@dataclass(frozen=True)
class Metadata:
    """What made the rows of a file, and what is needed to read and replay them."""

    robot: str
    """Name in the robot catalog."""
    policy: str
    """Name of the leg policy that the robot began with."""
    dtype: np.dtype
    """Layout of a row, from `row_dtype`."""
    nq: int
    """Numbers in qpos. `state` is time, qpos [nq], qvel [nv], then the rest of mjSTATE_INTEGRATION."""
    nv: int
    """Numbers in qvel."""
    substeps: int
    """Physics steps a row."""
    rate: float
    """Rows a second [Hz]."""
    policy_sha256: str = ""
    """Hash of the weights; empty without weights."""
    model_sha256: str = ""
    """Hash of the compiled model that is attached to the file; empty without one."""
    policies: tuple[str, ...] = ()
    """Meaning of the `policy` field by its value."""
    reasons: tuple[str, ...] = ()
    """Meaning of the `reason` field by its value."""
    versions: Mapping[str, str] = field(default_factory=dict)
    """Package -> version."""
    commit: str = ""
    """Git commit of the program, or unknown; see `policies.commit`."""

    def to_json(self) -> dict[str, Any]:
        """As JSON values, with the format, the names of modes and stages and the command layout."""
        fixed = {"format": FORMAT, "modes": MODES, "stages": STAGES, "command": COMMAND_LAYOUT}
        return fixed | asdict(self) | {"dtype": self.dtype.descr}

    @staticmethod
    def from_json(values: Mapping[str, Any]) -> Metadata:
        """The metadata that `to_json` wrote.

        Raises:
            ValueError: another format, a missing field, or rows that are not laid out as `row_dtype` does.
        """
        if values.get("format") != FORMAT:
            raise ValueError(f"it has format {values.get('format')!r}, this program reads format {FORMAT}")
        try:
            dtype = np.dtype([(name, kind, *map(tuple, shape)) for name, kind, *shape in values["dtype"]])
            own = {name: values[name] for name in Metadata.__dataclass_fields__}
            size = {name: dtype[name].shape[0] for name in ("ctrl", "state", "observation", "latent", "action")}
        except (KeyError, TypeError, IndexError) as error:
            raise ValueError(f"its metadata is incomplete ({error})") from error
        if dtype != row_dtype(size["ctrl"], size["state"], size["observation"], size["latent"], size["action"]):
            raise ValueError("its rows have an unknown layout")
        return Metadata(**own | {"dtype": dtype, "reasons": tuple(own["reasons"]), "policies": tuple(own["policies"])})

    def qpos(self, rows: np.ndarray) -> np.ndarray:
        """Joint positions before each row's step [n, nq]."""
        return rows["state"][:, 1 : 1 + self.nq]


@dataclass(frozen=True)
class EpisodeInfo:
    """One line of a list of episodes."""

    id: str
    number: int
    """Counts the episodes of one file."""
    file: Path
    start: float
    """Unix time [s]."""
    seconds: float = 0.0
    """Recorded ticks divided by their rate."""
    rows: int = 0
    label: str = ""
    """What was to be done, in words: the task that a policy is trained on."""
    success: bool | None = None
    seed: int = 0
    """Of the reset before it (see Plant.reset)."""
    gaps: int = 0
    """Places where the tick number did not go up by one."""
    missing: int = 0
    """Ticks that are missing there."""
    ended: Ending = "open"


@dataclass(frozen=True)
class Episode:
    """One episode with all its rows."""

    info: EpisodeInfo
    metadata: Metadata
    rows: np.ndarray
    """Records of `metadata.dtype` [n]."""
    model: bytes | None
    """The compiled MuJoCo model (MJB); None when it is damaged or was never attached."""


def holes(ticks: np.ndarray, previous: int | None = None) -> list[tuple[int, int]]:
    """Where tick numbers do not go up by one: (last tick before, first tick after) of each hole.

    `previous` is the tick before the first one, if there was any.
    """
    known = np.asarray(ticks, dtype=np.int64) if previous is None else np.concatenate([[previous], ticks]).astype(np.int64)
    at = np.flatnonzero(np.diff(known) != 1)
    return [(int(known[i]), int(known[i + 1])) for i in at]


def missing_ticks(ticks: np.ndarray, previous: int | None = None) -> tuple[int, int]:
    """(number of holes, ticks missing in them)."""
    found = holes(ticks, previous)
    return len(found), sum(max(after - before - 1, 0) for before, after in found)
