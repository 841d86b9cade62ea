"""`teleop-bench wrists`: how exactly the wrists follow people's motions while the robot walks as those people did.

The whole live policy runs on the play model: interpolation, inverse kinematics, feedforward, legs. Targets arrive at the tick rate;
where the wrists are when one comes is compared with it, as in a row of a recording, so that lag counts.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from policies.arm_model import ArmModel
from policies.bench.motions import motions
from policies.bench.tracking import LONGEST
from policies.command import Command
from policies.commit import commit
from policies.envelope import HEIGHT, TWIST
from policies.motion.clip import Clip
from policies.picture import canvas
from policies.whole_body import WholeBody
from robots import catalog
from robots.catalog import Robot
from robots.plant import Plant

MEASURED = ("joint targets", "operator's targets")
"""What the wrists are compared with."""
LEAD_IN = 2.0
"""Time in which the arms go to where the motion begins, the robot standing; not counted [s]."""
PAPER = "paper, four tasks on the real H1, signed means: x .011 to .044, y -.032 to -.018, z .002 to .008 m; .002 to .171 rad"


@dataclass(frozen=True)
class WristsBench:
    """Play people's motions through the live policy while the robot walks.

    Example: teleop-bench wrists --motions runs/clips.npz --json wrists.json
    """

    motions: Path | None = None
    """As in `teleop-bench paper`."""
    policy: str = "walk_h1"
    """Shipped weights by name, or a .safetensors file."""
    robot: str = "h1"
    """Name in the catalog."""
    json: Path | None = None
    """Also write the figures to this file."""
    picture: Path | None = None
    """Also draw how the errors are distributed, and those of every motion."""


def run(config: WristsBench) -> dict:
    """Play every motion once, print the table, return the JSON record."""
    robot = catalog.load(config.robot)
    clips, follower = motions(robot, config.motions).clips, _Follower(robot, config.policy)
    rows = [follower.play(clip) for clip in track(clips, "following", transient=True)]
    errors = np.concatenate([row for row, _ in rows])
    figures = {name: _figures(errors[:, i]) for i, name in enumerate(MEASURED)}
    record: dict = figures | {"clips": len(clips), "fell": sum(fell for _, fell in rows), "minutes": len(errors) / 3000, "commit": commit()}
    record["policy"] = config.policy
    table = Table(title=f"wrists over {record['minutes']:.1f} minutes of walking, {record['fell']} of {len(clips)} fell", caption=PAPER)
    columns = "measured against", "mean mm", "p95 mm", "mean °", "p95 °", "x y z: absolute mm", "signed mm", "absolute °", "signed °"
    for column in columns:
        table.add_column(column, justify="left" if column == columns[0] else "right")
    for name, values in figures.items():
        sizes = (f"{values[key]:.1f}" for key in ("mm", "mm_p95", "degrees", "degrees_p95"))
        axes = ("absolute_mm", "signed_mm", "absolute_degrees", "signed_degrees")
        table.add_row(name, *sizes, *(" ".join(f"{x:.1f}" for x in values[axis]) for axis in axes))
    Console(width=150).print(table)
    if config.json:
        config.json.write_text(json.dumps(record, indent=1) + "\n")
    if config.picture:
        _draw({clip.name: row for clip, (row, _) in zip(clips, rows, strict=True)}, config.picture)
    return record


def _figures(errors: np.ndarray) -> dict:
    """errors: translation [m] and rotation vector [rad] in the pelvis frame [n, 2 wrists, 6]."""
    places, turns = errors[..., :3], errors[..., 3:]
    far, turned = 1e3 * np.linalg.norm(places, axis=-1), np.degrees(np.linalg.norm(turns, axis=-1))
    values = {"mm": far.mean(), "mm_p95": np.percentile(far, 95), "degrees": turned.mean(), "degrees_p95": np.percentile(turned, 95)}
    axes = {"signed_mm": 1e3 * places.mean((0, 1)), "signed_degrees": np.degrees(turns.mean((0, 1)))}
    axes |= {"absolute_mm": 1e3 * np.abs(places).mean((0, 1)), "absolute_degrees": np.degrees(np.abs(turns).mean((0, 1)))}
    return {name: round(float(value), 2) for name, value in values.items()} | {k: v.round(2).tolist() for k, v in axes.items()}


def _draw(errors: dict[str, np.ndarray], path: Path) -> None:
    """errors: of every motion [ticks, 2, 2, 6], as `_Follower.play` returns them."""
    every = np.concatenate(list(errors.values()))
    share = np.linspace(0, 1, 500)
    with canvas(path, 1, 3, (15, 2 + 0.13 * len(errors))) as ((near, turned, single),):
        for i, name in enumerate(MEASURED):
            near.plot(np.quantile(1e3 * np.linalg.norm(every[:, i, :, :3], axis=-1), share), share, label=name)
            turned.plot(np.quantile(np.degrees(np.linalg.norm(every[:, i, :, 3:], axis=-1)), share), share, label=name)
        near.set(title="share of the time that a wrist is nearer than", xlabel="mm", xlim=(0, 60), ylim=(0, 1))
        turned.set(title="share of the time that it is turned less than", xlabel="degrees", xlim=(0, 10), ylim=(0, 1))
        means = {name: 1e3 * np.linalg.norm(row[:, 0, :, :3], axis=-1).mean() for name, row in errors.items()}
        names = sorted(means, key=means.__getitem__)
        single.barh(names, [means[name] for name in names])
        single.set(title=f"mean of each motion against the {MEASURED[0]}", xlabel="mm")
        single.tick_params(labelsize=6)
        for axis in (near, turned):
            axis.legend(fontsize=8)
            axis.grid(alpha=0.3)


class _Follower:
    def __init__(self, robot: Robot, policy: str) -> None:
        self._plant, self._policy, self._arms = Plant(robot), WholeBody(robot, policy), ArmModel(robot)
        self._upper, self._dt = robot.spec.group("waist", "arms"), 1 / robot.spec.policy_rate

    def play(self, clip: Clip) -> tuple[np.ndarray, bool]:
        """Errors against the joint targets and against the operator's targets [ticks, 2, 2, 6], and whether the robot fell."""
        state = self._plant.reset()
        self._policy.reset(state)
        frames = clip.q[: round(LONGEST / self._dt)]
        first = self._command(clip, 0, walking=False)
        for _ in range(round(LEAD_IN / self._dt)):
            state = self._plant.step(self._policy.act(state, first))
        rows = []
        for t in range(len(frames)):
            command, actual = self._command(clip, t), self._wrists(state.q[self._upper])
            target = self._policy.act(state, command)
            rows.append([_missing(actual, self._policy.trace.reached.reachable), _missing(actual, command.wrists)])
            state = self._plant.step(target)
            if state.fallen(0.5 * self._plant.spec.nominal_height):
                return np.array(rows), True
        return np.array(rows), False

    def _command(self, clip: Clip, t: int, walking: bool = True) -> Command:
        twist = np.clip(clip.twist[t], *TWIST) if walking else np.zeros(3)
        height = float(np.clip(clip.height[t], *HEIGHT))
        return Command(True, twist, height, wrists=self._wrists(clip.q[t]), waist=float(clip.q[t, 0]))

    def _wrists(self, q: np.ndarray) -> np.ndarray:
        self._arms.pose(q)
        return self._arms.wrists()


def _missing(actual: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """From wanted to actual poses [2, 7]: translation and rotation vector in the pelvis frame [2, 6]."""
    out = np.empty((2, 6))
    for row, a, b in zip(out, actual, wanted, strict=True):
        row[:3] = a[:3] - b[:3]
        spin = np.empty(3)
        mujoco.mju_subQuat(spin, a[3:], b[3:])
        mujoco.mju_rotVecQuat(row[3:], spin, b[3:])
    return out
