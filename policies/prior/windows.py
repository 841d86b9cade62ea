"""Windows of clips: a second of the past and a second of the future, drawn at random for training, in order for judging."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from policies.motion.clip import ClipSet
from policies.prior.errors import NoClips
from policies.prior.history import WINDOW


@dataclass(frozen=True)
class Variation:
    """How training windows differ from the clips."""

    amplitude: tuple[float, float] = (0.2, 1.1)
    """The motion's deviation from the home pose is scaled by a factor from this range in half of the windows: the leg policy's
    curriculum plays motions at amplitudes from 0 to 1."""
    speed: tuple[float, float] = (0.7, 1.4)
    """Playback speed, in half of the windows."""
    mixed: float = 0.15
    """Share of windows whose right arm is another window's: an operator's hands are less in step than a dancer's."""
    noise: float = 0.003
    """Deviation of white noise on the past [rad]: smooth clips let one read off accelerations that live targets blur."""


class Windows:
    """Clips laid end to end; time t of a window is the first frame of the future."""

    def __init__(self, clips: ClipSet, home: np.ndarray) -> None:
        """home: default angles of waist and arms [15], rad.

        Raises:
            NoClips: none is long enough.
        """
        usable = [clip for clip in clips.clips if len(clip.q) > WINDOW]
        if not usable:
            raise NoClips(f"no clip is longer than {WINDOW} frames")
        self._q = torch.tensor(np.concatenate([clip.q for clip in usable]), dtype=torch.float32)
        lengths = np.array([len(clip.q) for clip in usable])
        ends = torch.tensor(np.cumsum(lengths))
        starts = ends - torch.tensor(lengths)
        self._home = torch.tensor(home, dtype=torch.float32)
        self._right = torch.arange(len(home)) > len(home) // 2
        # every t whose future lies within its clip; a past that begins before the clip holds its first pose
        self._at = torch.cat([torch.arange(int(a) + 1, int(b) - WINDOW + 1) for a, b in zip(starts, ends, strict=True)])
        self._start = torch.cat([a.repeat(int(b - a) - WINDOW) for a, b in zip(starts, ends, strict=True)])
        self._end = torch.cat([b.repeat(int(b - a) - WINDOW) for a, b in zip(starts, ends, strict=True)])
        self.names = [clip.name for clip in usable for _ in range(len(clip.q) - WINDOW)]
        """Clip of each window."""

    def __len__(self) -> int:
        return len(self._at)

    def sample(self, count: int, variation: Variation) -> tuple[Tensor, Tensor]:
        """Random windows, varied: past and future [count, WINDOW, 15], rad."""
        row = torch.randint(len(self), (count,))
        speed = _half_of(torch.empty(count).uniform_(*variation.speed))
        history, future = self._cut(row, speed)
        mixed = (torch.rand(count, 1, 1) < variation.mixed) & self._right
        history, future = torch.where(mixed, history.roll(1, 0), history), torch.where(mixed, future.roll(1, 0), future)
        amplitude = _half_of(torch.empty(count).uniform_(*variation.amplitude))[:, None, None]
        history = self._home + amplitude * (history - self._home)
        return history + variation.noise * torch.randn_like(history), self._home + amplitude * (future - self._home)

    def every(self, stride: int, least_past: int = WINDOW) -> tuple[Tensor, Tensor, Tensor]:
        """Unvaried windows in order, one in `stride`, with at least so many real frames of past: past, future, and their rows."""
        row = torch.arange(0, len(self), stride)
        row = row[self._at[row] - self._start[row] >= least_past]
        return *self._cut(row, torch.ones(len(row))), row

    def _cut(self, row: Tensor, speed: Tensor) -> tuple[Tensor, Tensor]:
        offset = torch.arange(-WINDOW, WINDOW)
        time = self._at[row, None] + offset * speed[:, None]
        time = torch.minimum(torch.maximum(time, self._start[row, None]), self._end[row, None] - 1)
        whole = torch.minimum(time.floor().long(), self._end[row, None] - 2)
        part = (time - whole)[..., None]
        motion = self._q[whole] * (1 - part) + self._q[whole + 1] * part
        return motion[:, :WINDOW], motion[:, WINDOW:]


def _half_of(factor: Tensor) -> Tensor:
    """Half of the factors, 1 for the others."""
    return torch.where(torch.rand_like(factor) < 0.5, factor, torch.ones_like(factor))
