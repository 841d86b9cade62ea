"""Loads a model that came with a file, in a process of its own with limits: what it breaks there breaks nothing here.

MuJoCo reads a compiled model as it is and believes its numbers. This keeps crashes and endless memory or time away from the
program; it is no sandbox against a file made by somebody who means harm (see SECURITY.md).
"""

from __future__ import annotations

import resource
import subprocess
import sys

import mujoco

MEMORY = 4 << 30
"""Address space of the process [bytes]."""
SECONDS = 20
"""Processor time that loading and two steps may take; twice as long by the clock."""


def survives(compiled: bytes) -> bool:
    """Whether the model (MJB) can be loaded and stepped."""
    try:
        tried = subprocess.run([sys.executable, "-m", __name__], input=compiled, capture_output=True, timeout=2 * SECONDS)
    except subprocess.TimeoutExpired:
        return False
    return tried.returncode == 0


def main() -> None:
    """Load what comes by standard input. Exits with 0 when all went well."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
    mujoco.set_mju_user_warning(lambda text: None)  # otherwise it writes MUJOCO_LOG.TXT where the program was started
    model = mujoco.MjModel.from_binary_path("model.mjb", {"model.mjb": sys.stdin.buffer.read()})
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=2)


if __name__ == "__main__":
    main()
