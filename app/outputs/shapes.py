"""Surfaces of MuJoCo's primitive shapes."""

from __future__ import annotations

import mujoco
import numpy as np

Mesh = tuple[np.ndarray, np.ndarray]
"""Vertices [n, 3] and triangles [m, 3], counter-clockwise seen from outside."""

SLICES = 24
"""Around the axis of a round shape."""


class CannotDraw(Exception):
    """A shape without a surface here."""

    def __init__(self, kind: mujoco.mjtGeom) -> None:
        super().__init__(f"geoms of type {kind.name} cannot be drawn; use a mesh, box, sphere, ellipsoid, capsule or cylinder")


def surface(kind: mujoco.mjtGeom, size: np.ndarray) -> Mesh:
    """The surface of a primitive geom, in the geom's frame.

    Args:
        kind: box, sphere, ellipsoid, capsule or cylinder.
        size: as in MjModel.geom_size [3], m.

    Raises:
        CannotDraw: any other kind.
    """
    shape = mujoco.mjtGeom
    radius, half = float(size[0]), float(size[1])
    if kind == shape.mjGEOM_BOX:
        return _box(size)
    if kind == shape.mjGEOM_CYLINDER:
        return _turned([(0, -half), (radius, -half), (radius, half), (0, half)])
    if kind == shape.mjGEOM_CAPSULE:
        return _turned(_round(radius, half))
    if kind == shape.mjGEOM_SPHERE:
        return _turned(_round(radius, 0.0))
    if kind == shape.mjGEOM_ELLIPSOID:
        vertices, faces = _turned(_round(1.0, 0.0))
        return vertices * size, faces
    raise CannotDraw(kind)


def _round(radius: float, half: float) -> list[tuple[float, float]]:
    """Profile of a capsule whose cylinder is 2 half long."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, SLICES // 2 + 2)
    return [(radius * np.cos(a), radius * np.sin(a) + np.copysign(half, a)) for a in angles.tolist()]


def _turned(profile: list[tuple[float, float]]) -> Mesh:
    """A profile of (radius, z), from below to above, turned about z."""
    angle = np.arange(SLICES) * 2 * np.pi / SLICES
    rings = [np.stack([r * np.cos(angle), r * np.sin(angle), np.full(SLICES, z)], axis=1) for r, z in profile]
    this = np.arange(SLICES)
    following = (this + 1) % SLICES
    faces = []
    for ring in range(len(profile) - 1):
        low, high = ring * SLICES, (ring + 1) * SLICES
        faces.append(np.stack([low + this, low + following, high + following], axis=1))
        faces.append(np.stack([low + this, high + following, high + this], axis=1))
    return _without_slivers(np.concatenate(rings), np.concatenate(faces))


def _box(half: np.ndarray) -> Mesh:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return corners, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _without_slivers(vertices: np.ndarray, faces: np.ndarray) -> Mesh:
    """Without the triangles that have no area, at the poles."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return vertices, faces[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-12]
