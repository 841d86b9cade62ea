"""Errors of this folder, each one sentence that names the way out."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from app.errors import AppError


class ExportError(AppError):
    """An export that cannot be made as asked."""


class MissingPackage(ExportError):
    """A format needs a package that is not installed."""

    def __init__(self, format: str, package: str) -> None:
        super().__init__(f"--format {format} needs the package {package}; install it from the checkout with: pip install -e '.[export]'")


class NothingChosen(ExportError):
    """No episode fits."""

    def __init__(self, paths: Iterable[Path], known: Iterable[str]) -> None:
        where = ", ".join(map(str, paths))
        super().__init__(f"{where}: no finished episode fits; those with rows are: {'; '.join(known) or 'none'}")


class NotWhatWasRecorded(ExportError):
    """Reading the export back gave something else than the recording."""

    def __init__(self, episode: str, what: str, why: str) -> None:
        super().__init__(f"episode {episode}: {what} read back from the export {why}; nothing was kept, please report this")


class NoPictures(ExportError):
    """Nothing here can draw."""

    def __init__(self, tried: Iterable[str]) -> None:
        super().__init__(
            f"MuJoCo cannot draw here (tried MUJOCO_GL={', '.join(tried)}); "
            "install a software renderer with: apt-get install libosmesa6 - or export without pictures: --cameras none"
        )
