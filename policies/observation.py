"""What the leg policy sees: one vector a robot, built by the same code in training and at run time.

Each part knows how it looks in the sagittal mirror, so that networks can be mirror-equivariant by construction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from policies.gait import Gait
from robots.spec import RobotSpec
from robots.state import State

HISTORY = 3
"""Past frames of (gyro, gravity, leg q, leg dq, action)."""
LATENT = 64
"""Numbers of the predictive motion prior; its two halves swap in the mirror."""
ACTION_SCALE = 0.25
"""Radians a unit of action."""


@dataclass(frozen=True)
class Mirror:
    """A signed permutation that is its own inverse: `x[..., permutation] * sign` is x in the mirror."""

    permutation: np.ndarray
    sign: np.ndarray

    def __call__(self, x: np.ndarray) -> np.ndarray:
        return x[..., self.permutation] * self.sign

    def parity(self) -> tuple[np.ndarray, int]:
        """Orthonormal basis [size, size] in which x is an even part, unchanged by the mirror, then an odd part, negated; and the even
        part's size."""
        p, s, i = self.permutation, self.sign, np.arange(len(self.permutation))
        pair, fixed = i[i < p], i[i == p]
        plus, minus = fixed[s[fixed] > 0], fixed[s[fixed] < 0]
        even, half = len(pair) + len(plus), np.sqrt(0.5)
        rows, at = np.zeros((len(p), len(p))), np.arange(len(pair))
        rows[at, pair], rows[at, p[pair]] = half, half * s[pair]
        rows[len(pair) + np.arange(len(plus)), plus] = 1
        rows[even + at, pair], rows[even + at, p[pair]] = half, -half * s[pair]
        rows[even + len(pair) + np.arange(len(minus)), minus] = 1
        return rows, even

    @staticmethod
    def stack(parts: list[Mirror]) -> Mirror:
        """The mirror of a vector made of parts laid end to end."""
        starts = np.cumsum([0] + [len(p.sign) for p in parts])
        moved = [p.permutation + at for p, at in zip(parts, starts, strict=False)]
        return Mirror(np.concatenate(moved), np.concatenate([p.sign for p in parts]))

    @staticmethod
    def signs(*sign: float) -> Mirror:
        """Every number keeps its place."""
        return Mirror(np.arange(len(sign)), np.array(sign, dtype=float))

    @staticmethod
    def pairs(width: int, times: int, sign: tuple[float, ...] | None = None) -> Mirror:
        """`times` left-right couples of blocks that swap; sign [width] is applied to each block."""
        block = np.arange(width)
        order = [np.concatenate([block + width, block]) + 2 * width * i for i in range(times)]
        return Mirror(np.concatenate(order), np.tile(np.ones(width) if sign is None else np.array(sign), 2 * times))


VECTOR = Mirror.signs(1, -1, 1)
"""Positions, velocities, gravity."""
TURN = Mirror.signs(-1, 1, -1)
"""Angular velocities."""


def joint_mirror(spec: RobotSpec, group: slice) -> Mirror:
    """Mirror of the motors of a group that is closed under left and right."""
    permutation, sign = spec.mirror
    return Mirror(permutation[group] - group.start, sign[group])


def layout(spec: RobotSpec) -> dict[str, Mirror]:
    """Parts of the observation in their order, with their mirrors."""
    legs = joint_mirror(spec, spec.group("legs"))
    body = joint_mirror(spec, slice(0, spec.body_motors))
    parts = {
        "gyro": TURN,
        "gravity": VECTOR,
        "odometry": VECTOR,
        "twist": Mirror.signs(1, -1, -1),
        "posture": Mirror.signs(1, -1, 1),
        "clock": Mirror.signs(-1, -1, 1),
        "q": body,
        "dq": body,
        "action": legs,
    }
    frame = Mirror.stack([TURN, VECTOR, legs, legs, legs])
    past = {f"past_{i + 1}": frame for i in range(HISTORY)}
    return parts | past | {"latent": Mirror.pairs(LATENT // 2, 1)}


def where(spec: RobotSpec, part: str) -> slice:
    """The numbers of an observation that a part of the layout holds."""
    start = 0
    for name, mirror in layout(spec).items():
        if name == part:
            return slice(start, start + len(mirror.sign))
        start += len(mirror.sign)
    raise KeyError(part)


def action_mirror(spec: RobotSpec) -> Mirror:
    """Mirror of the leg policy's action."""
    return joint_mirror(spec, spec.group("legs"))


class Observer:
    """Builds observations [n, size] for `count` robots and remembers the past frames."""

    def __init__(self, spec: RobotSpec, count: int) -> None:
        self.spec = spec
        self.size = len(Mirror.stack(list(layout(spec).values())).sign)
        self._legs, self._body = spec.group("legs"), slice(0, spec.body_motors)
        self._past = np.zeros((HISTORY, count, 6 + 3 * (self._legs.stop - self._legs.start)), np.float32)
        self._fresh = np.ones(count, bool)

    def reset(self, mask: np.ndarray) -> None:
        """Forget the past of the robots in the mask; their next frame fills the history."""
        self._fresh |= mask

    def observe(
        self,
        state: State,
        gait: Gait,
        twist: np.ndarray,
        posture: np.ndarray,
        stance: np.ndarray,
        action: np.ndarray,
        latent: np.ndarray,
    ) -> np.ndarray:
        """One observation a robot, float32 [n, size].

        Args:
            twist: velocity command [n, 3], m/s and rad/s.
            posture: height [m], roll, pitch [rad] commands [n, 3].
            stance: leg angles of that posture [n, 12], rad (`policies.stance`).
            action: the previous action [n, 12].
            latent: the motion prior's z [n, 64]; zeros without a prior.
        """
        q = (state.q[:, self._body] - self.spec.home[self._body]).astype(np.float32)
        q[:, self._legs] = state.q[:, self._legs] - stance
        dq = 0.05 * state.dq[:, self._body].astype(np.float32)
        gyro, gravity = 0.25 * state.gyro, state.gravity
        frame = np.concatenate([gyro, gravity, q[:, self._legs], dq[:, self._legs], action], -1).astype(np.float32)
        self._past[:, self._fresh] = frame[self._fresh]
        self._fresh[:] = False
        asked = (posture - np.array([self.spec.nominal_height, 0, 0])) * np.array([4, 4, 4])
        now = [gyro, gravity, gait.velocity, 2 * twist, asked, gait.clock, q, dq, action, *self._past, latent]
        self._past[1:] = self._past[:-1].copy()
        self._past[0] = frame
        return np.concatenate(now, -1).astype(np.float32)


def leg_targets(spec: RobotSpec, stance: np.ndarray, action: np.ndarray) -> np.ndarray:
    """Joint targets of the legs for an action [..., 12] around a stance [..., 12], rad, within the joint limits."""
    legs = spec.group("legs")
    return np.clip(stance + ACTION_SCALE * action, spec.lower[legs], spec.upper[legs])
