"""What the motion prior expects the arms to do in the next second, for whoever asks; the loop that drives the robot does nothing for it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from fastapi import APIRouter

from app.protocol import Pose, Vector3, Wire
from app.shared import Ring
from policies.arm_model import ArmModel
from policies.prior.history import WINDOW, History
from policies.prior.single import Single
from robots.catalog import Robot

EVERY = 5
"""Ticks between two forecasts, and between two points of a path."""
AHEAD = 25
"""How far ahead a forecast is judged [ticks]: half a second."""
JUDGED = 500
"""Over how many ticks it is."""
LONGEST = 250
"""Who did not ask for so many ticks begins anew."""


class WristForecast(Wire):
    """One wrist, in the pelvis frame."""

    path: tuple[Vector3, ...]
    """Where it is told to be now and in 0.1, 0.2 to 1.0 s [m]."""
    pose: Pose
    """In half a second."""


class Forecast(Wire):
    """GET /api/forecast."""

    policy: str
    """Name of the leg weights that walk."""
    prior: str | None
    """Name of the motion prior that they see; None: they see none, and nothing is expected."""
    left: WristForecast | None = None
    right: WristForecast | None = None
    error: float | None = None
    """How far the wrists were from where they had been expected half a second before: the mean over both and the last 10 s [m].
    None until that is known."""
    still: float | None = None
    """The same for an expectation that they stay where they are [m]."""


@dataclass(frozen=True)
class _Guess:
    """A forecast that time will judge."""

    tick: int
    expected: np.ndarray
    """Positions of the wrists `AHEAD` ticks later [2, 3]."""
    now: np.ndarray
    """And where they were [2, 3]."""


class Forecaster:
    """Follows the targets of the arms in shared memory, from when it is asked, and decodes what the prior makes of them."""

    def __init__(self, robot: Robot, policies: Sequence[str], priors: Sequence[str | None], snapshots: Ring) -> None:
        """
        Args:
            robot: whose arms they are.
            policies: names of the leg weights, in the order of `policy` in a snapshot.
            priors: the motion prior of each.
            snapshots: see app.shared.snapshot_dtype.

        Raises:
            UnknownPolicy, WrongWeights, DamagedWeights: see `policies.checkpoint`.
        """
        self._policies, self._names, self._snapshots = policies, priors, snapshots
        self._priors = {name: Single.load(name, robot.spec) for name in set(priors) if name}
        self._arms = ArmModel(robot)
        self._history, self._past = History(1, self._arms.size), np.empty((WINDOW, 0))
        self._tick = -LONGEST - 1
        self._policy = -1
        self._forget()

    def now(self) -> Forecast:
        """The forecast of this moment, at most `EVERY` ticks old."""
        policy = self._follow()
        if policy != self._policy:
            self._policy = policy
            self._forget()
        if self._tick - self._told >= EVERY:
            self._told, self._forecast = self._tick, self._made()
        return self._forecast

    def _forget(self) -> None:
        """Nothing that was expected is judged any more."""
        self._guesses: deque[_Guess] = deque()
        self._judged: deque[tuple[int, float, float]] = deque()
        self._told = -EVERY

    def _follow(self) -> int:
        """Take in the targets of the ticks since the last call; returns which legs walk."""
        late = self._snapshots.count - self._tick > LONGEST
        if late:  # the second that the prior sees is enough
            self._tick = max(0, self._snapshots.count - WINDOW)
        records, lost = self._snapshots.since(self._tick)
        self._tick += lost
        for i, record in enumerate(records):
            if record["jump"] or (i == 0 and (late or lost)):
                self._history.reset(np.ones(1, bool), record["upper"][None])
                self._forget()
            self._past = self._history.push(record["upper"][None])[0]
            self._tick += 1
            self._judge()
        return int(records[-1]["policy"]) if records else self._policy

    def _made(self) -> Forecast:
        policy, name = self._policies[self._policy], self._names[self._policy]
        if name is None:
            return Forecast(policy=policy, prior=None)
        coming = self._priors[name].predict(self._past)
        now, paths = self._wrists(self._past[-1]), np.stack([self._wrists(q) for q in coming[EVERY - 1 :: EVERY]])
        pose = paths[AHEAD // EVERY - 1]
        self._guesses.append(_Guess(self._tick, pose[:, :3], now[:, :3]))
        left, right = (_wrist(np.vstack([now[None, side], paths[:, side]]), pose[side]) for side in range(2))
        _, error, still = np.mean(self._judged, axis=0).tolist() if self._judged else (0, None, None)
        return Forecast(policy=policy, prior=name, left=left, right=right, error=error, still=still)

    def _judge(self) -> None:
        """Compare what was expected for this tick with what came."""
        if self._guesses and self._guesses[0].tick + AHEAD == self._tick:
            guess = self._guesses.popleft()
            came = self._wrists(self._past[-1])[:, :3]
            error, still = (float(np.linalg.norm(came - other, axis=1).mean()) for other in (guess.expected, guess.now))
            self._judged.append((guess.tick, error, still))
        while self._judged and self._judged[0][0] < self._tick - JUDGED:
            self._judged.popleft()

    def _wrists(self, q: np.ndarray) -> np.ndarray:
        """Poses in the pelvis frame [2, 7] at joint angles [15], rad."""
        self._arms.pose(q)
        return self._arms.wrists()


def router(forecast: Callable[[], Forecast]) -> APIRouter:
    """GET /api/forecast."""
    api = APIRouter(tags=["picture"])

    @api.get("/api/forecast")
    async def read_forecast() -> Forecast:
        """What the motion prior of the legs expects the wrists to do in the next second; anew ten times a second."""
        return forecast()

    return api


def _wrist(path: np.ndarray, pose: np.ndarray) -> WristForecast:
    """path: poses [n, 7]; pose: one of them [7]."""
    x, y, z, *turn = pose.tolist()
    return WristForecast(path=tuple(map(tuple, path[:, :3].tolist())), pose=Pose(position=(x, y, z), quaternion=tuple(turn)))
