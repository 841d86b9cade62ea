"""What a MuJoCo model looks like, as meshes for a picture: visual geoms by body and colour, sharp edges kept sharp."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import fast_simplification
import mujoco
import numpy as np

from app.outputs import shapes
from app.outputs.shapes import Mesh

VISUAL_GROUPS = 3
"""Geoms of groups below this are drawn; the others are collision shapes."""
SHARP = np.deg2rad(35)
"""Faces that meet at a larger angle are shaded apart [rad]."""

Rgb = tuple[int, int, int]


@dataclass(frozen=True)
class Look:
    """One mesh of one colour, in the frame of its body."""

    body: int
    """Index in the model."""
    rgb: Rgb
    vertices: np.ndarray
    """[n, 3], m"""
    faces: np.ndarray
    """[m, 3]"""


def looks(model: mujoco.MjModel) -> list[Look]:
    """The visual geoms of every body but the world, one mesh a body and colour."""
    parts: dict[tuple[int, Rgb], list[Mesh]] = defaultdict(list)
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        if body != 0 and model.geom_group[geom] < VISUAL_GROUPS:
            parts[body, _rgb(model, geom)].append(_surface(model, geom))
    return [Look(body, rgb, *creased(*_joined(meshes))) for (body, rgb), meshes in parts.items()]


def subtree(model: mujoco.MjModel, found: list[Look], root: str, frame: str, faces: int) -> Mesh:
    """One coarse mesh of everything that hangs on a body, in a site's frame, all joints at home.

    Args:
        model: the model of `found`.
        found: from `looks`.
        root: name of the body.
        frame: name of the site.
        faces: about how many triangles to keep.
    """
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    mujoco.mj_kinematics(model, data)
    rotation, origin = data.site(frame).xmat.reshape(3, 3), data.site(frame).xpos
    meshes = []
    for look in found:
        if _hangs_on(model, look.body, model.body(root).id):
            world = look.vertices @ data.xmat[look.body].reshape(3, 3).T + data.xpos[look.body]
            meshes.append(((world - origin) @ rotation, look.faces))
    vertices, triangles = _joined(meshes)
    if len(triangles) > faces:
        vertices, triangles = fast_simplification.simplify(vertices, triangles, target_count=faces)[:2]
    return vertices, triangles


def creased(vertices: np.ndarray, faces: np.ndarray) -> Mesh:
    """The same surface, its vertices doubled along sharp edges, so that shading does not smear over them.

    Two faces share a vertex if one can walk around it from face to face without crossing a sharp edge.

    Args:
        vertices: [n, 3]
        faces: [m, 3]
    """
    vertices, faces = _welded(vertices, faces)
    one, other = _smooth_neighbours(vertices, faces)
    corners = np.arange(faces.size)  # corner 3 f + k is vertex k of face f
    following = corners - corners % 3 + (corners + 1) % 3
    ends = faces.ravel()
    aligned = ends[one] == ends[other]  # neighbours usually run along their edge in opposite directions
    start, end = np.where(aligned, other, following[other]), np.where(aligned, following[other], other)
    label = _connected(corners, np.concatenate([one, following[one]]), np.concatenate([start, end]))
    kept, index = np.unique(label, return_inverse=True)
    return vertices[ends[kept]], index.reshape(-1, 3)


def _smooth_neighbours(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of corners whose edges (corner to next corner) are one edge of two faces that meet smoothly [k], [k]."""
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    same = np.all(edges[order[1:]] == edges[order[:-1]], axis=1)
    one, other = order[:-1][same], order[1:][same]
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    smooth = np.einsum("ij,ij->i", normals[one // 3], normals[other // 3]) > np.cos(SHARP)
    return one[smooth], other[smooth]


def _connected(nodes: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The smallest node of every node's connected component; a[i] and b[i] are linked."""
    label = nodes.copy()
    while True:
        low = np.minimum(label[a], label[b])
        if np.array_equal(low, label[a]) and np.array_equal(low, label[b]):
            return label
        np.minimum.at(label, a, low)
        np.minimum.at(label, b, low)


def _welded(vertices: np.ndarray, faces: np.ndarray) -> Mesh:
    """Vertices that lie within a hundredth of a millimetre become one."""
    grid = np.round(vertices * 1e5).astype(np.int64)
    _, first, index = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    return vertices[first], index.reshape(-1)[faces]


def _joined(meshes: list[Mesh]) -> Mesh:
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    vertices = np.concatenate([vertices for vertices, _ in meshes])
    return vertices, np.concatenate([faces + start for (_, faces), start in zip(meshes, starts, strict=False)])


def _hangs_on(model: mujoco.MjModel, body: int, root: int) -> bool:
    while body not in (0, root):
        body = int(model.body_parentid[body])
    return body == root


def _rgb(model: mujoco.MjModel, geom: int) -> Rgb:
    material = model.geom_matid[geom]
    rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
    red, green, blue = (np.clip(rgba[:3], 0, 1) * 255).astype(int).tolist()
    return red, green, blue


def _surface(model: mujoco.MjModel, geom: int) -> Mesh:
    """A geom's surface in its body's frame."""
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        vertices = model.mesh_vert[start : start + count]
        start, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
        faces = model.mesh_face[start : start + count]
    else:
        vertices, faces = shapes.surface(mujoco.mjtGeom(model.geom_type[geom]), model.geom_size[geom])
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    return vertices @ rotation.reshape(3, 3).T + model.geom_pos[geom], faces
