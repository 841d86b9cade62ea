"""Lets a hand take the robot's wrist along and let it go again, without a jump: only how the hand moves counts."""

from __future__ import annotations

import mujoco
import numpy as np

from app.one_euro import turn_between

JUMP, JUMP_TURN = 0.06, np.deg2rad(25)
"""Between two packets of a headset at 60 Hz no hand moves further; what does was tracked wrongly [m], [rad]."""
PERIOD, PATIENCE = 1 / 60, 3.0
"""Of such packets [s]; and how many periods a gap in them may count for."""
STALE = 0.2
"""A hand that was not seen for this long is taken up anew [s]."""


class Clutch:
    """One wrist. Poses are position [m] and quaternion wxyz [7]; the hand's in axes parallel to the pelvis frame's."""

    def __init__(self) -> None:
        self._start: tuple[np.ndarray, np.ndarray] | None = None
        """Where the hand and the wrist were when they were coupled."""
        self._seen: tuple[np.ndarray, float] | None = None
        self._asked: np.ndarray | None = None

    def release(self) -> None:
        """Let go: the next step couples hand and wrist where they are then."""
        self._start = self._seen = self._asked = None

    def step(self, hand: np.ndarray | None, now: float, scale: float, applied: np.ndarray) -> np.ndarray | None:
        """The wrist's target [7], or None while the hand is not seen: the arm holds.

        Args:
            hand: its pose [7], or None.
            now: when it was seen [s].
            scale: metres of the wrist for a metre of the hand.
            applied: where the robot is told to have its wrist now [7].
        """
        if hand is None:
            self._start = None
            return None
        if self._start is None or self._lost(hand, now):
            self._start = (hand, applied if self._asked is None else self._asked)
        self._seen = (hand, now)
        (hand_then, wrist_then), turn, wrist_now = self._start, np.empty(4), np.empty(7)
        mujoco.mju_negQuat(turn, hand_then[3:])
        mujoco.mju_mulQuat(turn, hand[3:], turn.copy())
        mujoco.mju_mulQuat(wrist_now[3:], turn, wrist_then[3:])
        wrist_now[3:] /= np.linalg.norm(wrist_now[3:])
        wrist_now[:3] = wrist_then[:3] + scale * (hand[:3] - hand_then[:3])
        self._asked = wrist_now
        return wrist_now

    def _lost(self, hand: np.ndarray, now: float) -> bool:
        """Whether this cannot be the movement of a hand."""
        if self._seen is None:
            return True
        before, then = self._seen
        if now - then > STALE:
            return True
        periods, turn = min(max((now - then) / PERIOD, 1.0), PATIENCE), turn_between(before[3:], hand[3:])
        return bool(np.linalg.norm(hand[:3] - before[:3]) > JUMP * periods or np.linalg.norm(turn) > JUMP_TURN * periods)
