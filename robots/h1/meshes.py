"""What the H1 looks like in the play model."""

from __future__ import annotations

import mujoco


def dress(spec: mujoco.MjSpec, bodies: dict[str, mujoco.MjsBody], capsules: dict[str, tuple[str, tuple, tuple, float]]) -> None:
    """Give every link a visible shape: meshes of the installed data packages, else the collision capsules."""
