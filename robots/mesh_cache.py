"""Triangle meshes of installed data packages, simplified once and kept in the user's cache."""

from __future__ import annotations

import hashlib
import logging
import os
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

RECIPE = 1
"""Raise this when the simplification below changes: it is part of the key of a cached file."""

AGGRESSIVENESS = 3
"""How boldly triangles are merged. The library's default of 7 dents shells; below 3 it stops before the asked-for number."""

logger = logging.getLogger(__name__)


class Mesh(NamedTuple):
    """Triangles in a link's frame."""

    vertices: np.ndarray
    """[n, 3] float32, m."""
    faces: np.ndarray
    """Vertex numbers, counter-clockwise seen from outside [m, 3] int32."""


@dataclass(frozen=True)
class Source:
    """A mesh file and how it becomes a link's mesh: cut, then scaled, then moved, then simplified."""

    file: Path
    cut: tuple[float, float] | None = None
    """Keep what lies between these two x [m]; None keeps all."""
    scale: tuple[float, float, float] = (1, 1, 1)
    shift: tuple[float, float, float] = (0, 0, 0)
    """m"""
    keep: float = 1.0
    """Share of the triangles to keep."""
    floor: int = 1000
    """Simplify to no fewer triangles than this."""


def load(sources: dict[str, Source], label: str) -> dict[str, Mesh]:
    """The simplified mesh of every source. Slow (seconds) the first time, then read from one file in the cache.

    A cached file's name holds `label`, the recipe's version and a digest of the sources and what they contain. It appears
    whole or not at all, so processes may start together. A damaged file is made anew; without a place to write, nothing is kept.
    """
    try:
        kept = _directory() / f"{label}-v{RECIPE}-{_digest(sources)}.npz"
    except RuntimeError as no_home:
        logger.warning("meshes are simplified at every start: %s", no_home)
        return _simplify_all(sources)
    meshes = _read(kept, list(sources))
    if meshes is None:
        meshes = _simplify_all(sources)
        _write(kept, meshes)
    return meshes


def _directory() -> Path:
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "humanoid-teleop"


def _digest(sources: dict[str, Source]) -> str:
    digest = hashlib.sha256()
    for name, source in sorted(sources.items()):
        digest.update(repr((name, source.cut, source.scale, source.shift, source.keep, source.floor)).encode())
        digest.update(source.file.read_bytes())
    return digest.hexdigest()[:16]


def _read(kept: Path, names: list[str]) -> dict[str, Mesh] | None:
    """What a cached file holds; None if there is none or it is damaged."""
    try:
        with kept.open("rb") as file, np.load(file) as arrays:
            return {name: Mesh(arrays[f"{name}.vertices"], arrays[f"{name}.faces"]) for name in names}
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as damage:
        logger.warning("%s is damaged and will be made anew: %s", kept, damage)
        return None


def _write(kept: Path, meshes: dict[str, Mesh]) -> None:
    arrays = {f"{name}.{part}": array for name, mesh in meshes.items() for part, array in mesh._asdict().items()}
    try:
        kept.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=kept.parent, prefix=kept.stem, suffix=".part", delete=False) as part:
            np.savez(part, **arrays)
        os.replace(part.name, kept)
    except OSError as refused:
        logger.warning("meshes are simplified at every start, for %s cannot be written: %s", kept.parent, refused)


def _simplify_all(sources: dict[str, Source]) -> dict[str, Mesh]:
    return {name: _simplify(source) for name, source in sources.items()}


def _simplify(source: Source) -> Mesh:
    # these take half a second to import and are needed once
    from fast_simplification import simplify
    from trimesh import Trimesh, load_mesh
    from trimesh.intersections import slice_faces_plane

    mesh = load_mesh(source.file)
    if not isinstance(mesh, Trimesh):
        raise ValueError(f"{source.file} holds no triangles")
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    for limit, side in zip(source.cut or (), (1, -1), strict=False):
        vertices, faces, _ = slice_faces_plane(vertices, faces, np.array([side, 0, 0]), np.array([limit, 0, 0]))
    vertices, faces = vertices * source.scale + source.shift, np.asarray(faces, dtype=np.int32)
    target = max(source.floor, round(source.keep * len(faces)))
    if target < len(faces):
        vertices, faces, *_ = simplify(vertices, faces, target_count=target, agg=AGGRESSIVENESS)
    return Mesh(vertices.astype(np.float32), faces.astype(np.int32))
