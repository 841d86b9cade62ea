"""Fingers: a human hand's joints in, the drives of a robot hand out, once a measurement.

Vector retargeting (after DexPilot, Handa et al. 2019): fingers bend as the human's do, and the gaps between the thumb and
the other fingertips are kept the more exactly the smaller they are, so that a pinch stays a pinch on a hand of other
proportions.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import daqp
import mujoco
import numpy as np

from policies.hand_model import HandModel, drive_range, palm_axes
from robots.spec import RobotSpec

JOINTS = 21
"""Of a human hand: wrist, then four a finger from its base to its tip, thumb first (MediaPipe's order)."""
OF_WEBXR = np.array([i for i in range(25) if i not in (5, 10, 15, 20)])
"""The 21 among WebXR's 25, which name the metacarpals of the four fingers too."""
KNUCKLES, TIPS, MIDDLE = np.array([1, 5, 9, 13, 17]), np.array([4, 8, 12, 16, 20]), np.array([0, 9, 10, 11, 12])

REACH = 0.25
"""A joint farther than this from the wrist was not seen [m]."""
PLACE = np.array([0.6, 1.0, 1.0, 1.0, 1.0])[:, None, None]
"""Weights of the tips' places: the thumb's from the index knuckle, every other finger's from its own [5, 1, 1]."""
PINCH = 10.0
"""Weight of a closed pinch's gap."""
TOUCHING = 0.15
"""Weight of the posture in which thumb and finger touch [m/rad]: it leads out of places where the gap alone is stuck."""
NEAR, FAR = 0.025, 0.07
"""Gaps [m] of the robot's size: up to the first a pinch counts fully, from the second on not at all."""
CLOSER = 0.003
"""A human's joints end inside the flesh: of a small gap this much is closed more [m]."""
STILL = 0.003
"""Weight of staying [m/rad]: what the human hand leaves open does not tremble."""
SMOOTH = 0.035
"""Time constant of the smoothing [s]; a quick movement is smoothed less."""
QUICK = 0.15
"""A change of this size [rad] passes without smoothing."""
STEPS = 2
"""Gauss-Newton steps a measurement."""
TRUST = 0.4
"""Largest turn of a drive in one of them [rad]."""


@dataclass(frozen=True)
class Wanted:
    """What a human hand asks of a robot's."""

    tips: np.ndarray
    """In the palm's frame [5, 3], m."""
    gaps: np.ndarray
    """From the thumb's tip to the others' [4], m."""
    weight: np.ndarray
    """Of the gaps [4]."""
    touch: np.ndarray
    """Posture in which the nearest finger touches the thumb [6], rad."""
    pull: np.ndarray
    """Its weight [6], 1/rad."""


class HandRetargeter:
    """One hand. It goes on from its last answer."""

    def __init__(self, spec: RobotSpec, model: mujoco.MjModel, side: int) -> None:
        """side: 0 left, 1 right. model: a play model, only read."""
        self._hand = HandModel(spec, model, side)
        opened, closed = drive_range(spec)
        half = slice(side * len(opened) // 2, (side + 1) * len(opened) // 2)
        self._open, self._closed = opened[half], closed[half]
        self._size = float(np.linalg.norm(self._hand.knuckles[2]) + self._hand.lengths[2])
        drives = len(self._open)
        self._none = np.empty((0, drives))
        self._rows, self._missing = np.zeros((19, drives)), np.zeros(19)
        self.touches = [self._touch(finger) for finger in range(4)]
        """Of thumb and each other finger: the drives [6], rad, that bring them closest, and the gap that is left [m]."""
        self._least = np.array([least for _, least in self.touches])
        self.reset()

    def twin(self) -> HandRetargeter:
        """Another human hand's, in the same thread: it shares the robot's model and goes on from an answer of its own."""
        twin = copy.copy(self)
        twin.reset()
        return twin

    def reset(self) -> None:
        """Forget the past: the next answer starts from the open hand and is not smoothed."""
        self._q = self._open.copy()
        self._smooth: np.ndarray | None = None

    @property
    def q(self) -> np.ndarray:
        """Angles of the newest answer [6], rad."""
        return self._q if self._smooth is None else self._smooth

    def solve(self, joints: np.ndarray, dt: float = 1 / 60) -> np.ndarray:
        """The drives for a human hand, 0 open, 1 closed [6]; as before for what is no hand. Never raises.

        Args:
            joints: of the hand of the same side, in any frame [21, 3], m.
            dt: since the last call [s].
        """
        seen = _in_palm(joints)
        if seen is not None:
            self._descend(self._wanted(*seen))
            self._blend(dt)
        return (self.q - self._open) / (self._closed - self._open)

    def scale(self, joints: np.ndarray) -> float:
        """Size of the robot's hand, the human's being 1; by wrist to knuckle to tip of the middle finger [21, 3]."""
        return self._size / float(_lengths(joints[MIDDLE[1:]] - joints[MIDDLE[:-1]]).sum())

    def tips(self) -> np.ndarray:
        """Where the newest answer puts the fingertips, in the palm's frame [5, 3], m."""
        self._hand.place(self.q)
        return self._hand.tips()

    def _wanted(self, points: np.ndarray, lengths: np.ndarray) -> Wanted:
        hand, scale = self._hand, self.scale(points)
        bends = hand.knuckles + (points[TIPS] - points[KNUCKLES]) * (hand.lengths / lengths)[:, None]
        opposed = hand.knuckles[1] + (points[TIPS[0]] - points[KNUCKLES[1]]) * scale
        gaps = scale * _lengths(points[TIPS[1:]] - points[TIPS[0]])
        share = np.clip((FAR - gaps) / (FAR - NEAR), 0.0, 1.0)
        weight = (share * (gaps.min() + 0.01) / (gaps + 0.01)) ** 2
        finger = int(gaps.argmin())
        touch = self.touches[finger][0]
        pull = np.zeros_like(touch)
        pull[[0, 1, 2 + finger]] = TOUCHING * weight[finger]
        gaps = np.maximum(gaps - CLOSER * share, self._least)
        return Wanted(np.vstack([opposed, bends[1:]]), gaps, PINCH * weight, touch, pull)

    def _descend(self, wanted: Wanted) -> None:
        hand, rows, missing, before = self._hand, self._rows, self._missing, self._q
        weight, pull = wanted.weight, wanted.pull**2
        for _ in range(STEPS):
            hand.place(self._q)
            tips, jacobian = hand.tips(), hand.jacobian()
            apart = tips[1:] - tips[0]
            width = _lengths(apart)
            along = (weight / np.maximum(width, 1e-4))[:, None, None] * apart[:, None]
            rows[:15] = (PLACE * jacobian).reshape(15, -1)
            rows[15:] = (along @ (jacobian[1:] - jacobian[0]))[:, 0]
            missing[:15] = (PLACE[:, :, 0] * (wanted.tips - tips)).ravel()
            missing[15:] = weight * (wanted.gaps - width)
            hessian = rows.T @ rows
            hessian.ravel()[:: len(before) + 1] += STILL**2 + pull
            slope = STILL**2 * (self._q - before) + pull * (self._q - wanted.touch) - rows.T @ missing
            low, high = np.maximum(self._open - self._q, -TRUST), np.minimum(self._closed - self._q, TRUST)
            step, _, flag, _ = daqp.solve(hessian, slope, self._none, high, low)
            if flag < 1 or not np.isfinite(step).all():
                return
            self._q = np.clip(self._q + step, self._open, self._closed)
            if np.abs(step).max() < 2e-3:
                return

    def _touch(self, finger: int) -> tuple[np.ndarray, float]:
        """The drives [6], rad, that bring thumb and a finger closest, the others open; and the gap that is left [m]."""
        hand, low, high = self._hand, self._open, self._closed
        q, drive = low.copy(), 2 + finger
        bends = np.linspace(low[drive], high[drive], 60)
        pairs = [(yaw, pitch) for yaw in np.linspace(low[0], high[0], 24) for pitch in np.linspace(low[1], high[1], 16)]

        def tip(which: int, drives: list[int], angles: object) -> np.ndarray:
            at = low.copy()
            at[drives] = angles
            hand.place(at)
            return hand.tips()[which]

        curve = np.array([tip(1 + finger, [drive], bend) for bend in bends])
        thumbs = np.array([tip(0, [0, 1], pair) for pair in pairs])
        gaps = np.linalg.norm(thumbs[:, None] - curve, axis=2)
        thumb, bend = np.unravel_index(gaps.argmin(), gaps.shape)
        q[[0, 1, drive]] = (*pairs[thumb], bends[bend])
        return q, float(gaps.min())

    def _blend(self, dt: float) -> None:
        if self._smooth is None:
            self._smooth = self._q
            return
        change = np.abs(self._q - self._smooth)
        share = 1 - np.exp(-dt / SMOOTH)
        self._smooth = self._smooth + (share + (1 - share) * np.minimum(change / QUICK, 1.0)) * (self._q - self._smooth)


def _in_palm(joints: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """The joints in the palm's frame [21, 3] and the lengths of the fingers along their bones [5]; None if they are no hand."""
    joints = np.asarray(joints, dtype=float)
    if joints.shape != (JOINTS, 3):
        return None
    points = joints - joints[0]
    if not np.all(np.abs(points) < REACH):  # false for a NaN
        return None
    try:
        points = points @ palm_axes(points[0], points[KNUCKLES]).T
    except ValueError:
        return None
    fingers = points[1:].reshape(5, 4, 3)
    bones = _lengths(fingers[:, 1:] - fingers[:, :-1])
    return None if bones.min() < 1e-3 else (points, bones.sum(axis=1))


def _lengths(vectors: np.ndarray) -> np.ndarray:
    return np.sqrt((vectors * vectors).sum(axis=-1))
