"""Meshes of the picture."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from app.outputs import shapes
from app.outputs.geometry import creased, looks, subtree

GEOM = mujoco.mjtGeom
MODEL = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1"/>
    <body name="arm" pos="0 0 1" euler="0 0 90">
      <joint name="turn" axis="0 0 1"/>
      <geom type="box" size=".1 .2 .3" pos="1 0 0" rgba="1 0 0 1"/>
      <geom type="sphere" size=".1" rgba="0 1 0 1"/>
      <geom type="capsule" size=".5 .5" group="3"/>
      <body name="hand" pos="1 0 0">
        <geom type="sphere" size=".1" rgba="0 1 0 1"/>
        <site name="palm" pos="0 0 .5" euler="90 0 0"/>
      </body>
    </body>
  </worldbody>
  <keyframe><key name="home" qpos="1.5"/></keyframe>
</mujoco>
"""


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@pytest.mark.parametrize(
    ("kind", "size", "exact"),
    [
        (GEOM.mjGEOM_BOX, (0.1, 0.2, 0.3), 8 * 0.1 * 0.2 * 0.3),
        (GEOM.mjGEOM_SPHERE, (1, 0, 0), 4 / 3 * np.pi),
        (GEOM.mjGEOM_CYLINDER, (1, 0.5, 0), np.pi),
        (GEOM.mjGEOM_CAPSULE, (1, 0.5, 0), np.pi * 7 / 3),
        (GEOM.mjGEOM_ELLIPSOID, (1, 2, 3), 8 * np.pi),
    ],
)
def test_a_shape_faces_outwards_and_has_its_size(kind, size, exact):
    assert volume(*shapes.surface(kind, np.array(size, dtype=float))) == pytest.approx(exact, rel=0.04)


def test_a_shape_without_a_surface_is_named():
    with pytest.raises(shapes.CannotDraw, match="mjGEOM_PLANE"):
        shapes.surface(GEOM.mjGEOM_PLANE, np.ones(3))


def test_sharp_edges_part_the_shading_and_smooth_ones_do_not():
    box, ball = shapes.surface(GEOM.mjGEOM_BOX, np.ones(3)), shapes.surface(GEOM.mjGEOM_SPHERE, np.ones(3))
    can = shapes.surface(GEOM.mjGEOM_CYLINDER, np.ones(3))
    rim = 2 * shapes.SLICES
    assert len(creased(*box)[0]) == 3 * 8
    assert len(creased(*ball)[0]) == len(np.unique(ball[0].round(6), axis=0))
    assert len(creased(*can)[0]) == 2 * rim + 2
    for mesh in (box, ball, can):
        assert volume(*creased(*mesh)) == pytest.approx(volume(*mesh))


def test_looks_are_the_visual_geoms_of_each_body_by_colour():
    model = mujoco.MjModel.from_xml_string(MODEL)
    found = {(model.body(look.body).name, look.rgb): look for look in looks(model)}
    assert set(found) == {("arm", (255, 0, 0)), ("arm", (0, 255, 0)), ("hand", (0, 255, 0))}
    box = found["arm", (255, 0, 0)].vertices
    np.testing.assert_allclose([box.min(0), box.max(0)], [[0.9, -0.2, -0.3], [1.1, 0.2, 0.3]], atol=1e-9)


def test_a_subtree_is_seen_from_its_site():
    model = mujoco.MjModel.from_xml_string(MODEL)
    vertices, faces = subtree(model, looks(model), "hand", "palm", faces=100)
    np.testing.assert_allclose(vertices.mean(0), [0, -0.5, 0], atol=0.02)  # the site looks along the hand's -y
    assert np.ptp(vertices, axis=0).max() < 0.21
    assert 60 <= len(faces) <= 110
