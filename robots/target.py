"""What a policy asks of a robot for one tick."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Target:
    """Joint targets for one tick. Robots own it: a policy aims, the motors follow."""

    q: np.ndarray
    """Motor angle targets [..., nu] in motor order, rad."""
