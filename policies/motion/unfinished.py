"""What a retargeting that was cut short has made so far: the same command goes on from there."""

from __future__ import annotations

import hashlib
import os
import shutil
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from policies.motion.retarget import Retargeted


class Unfinished:
    """One small file for each motion, in a hidden folder beside the file to come. `done` removes it."""

    def __init__(self, out: Path, robot: str) -> None:
        self._folder, self._robot = out.with_name(f".{out.name}.unfinished"), robot

    def find(self, source: Path) -> Retargeted | None:
        """What an earlier run made of this very file, if it came so far."""
        try:
            with np.load(self._path(source), allow_pickle=False) as stored:
                made: dict[str, Any] = {name: value if value.ndim else float(value) for name, value in stored.items()}
                return Retargeted(**made)
        except (OSError, ValueError, TypeError, EOFError, zipfile.BadZipFile):
            return None

    def keep(self, source: Path, made: Retargeted) -> None:
        """Store it; a crash leaves nothing or all of it."""
        self._folder.mkdir(parents=True, exist_ok=True)
        path = self._path(source)
        aside = path.with_name(f"{path.stem}.{os.getpid()}.part")
        with aside.open("wb") as file:
            np.savez(file, allow_pickle=False, **vars(made))
        aside.replace(path)

    def done(self) -> None:
        """The file is written."""
        shutil.rmtree(self._folder, ignore_errors=True)

    def _path(self, source: Path) -> Path:
        stat = source.stat()
        key = f"{self._robot} {source.resolve()} {stat.st_size} {stat.st_mtime_ns}"
        return self._folder / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.npz"
