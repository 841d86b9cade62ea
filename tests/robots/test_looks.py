"""What the H1 looks like, with its mesh packages and without."""

import importlib.util

import mujoco
import numpy as np
import pytest

from robots import catalog
from robots.h1 import meshes
from robots.h1.spec import H1

ROBOT = catalog.load("h1")
needs_meshes = pytest.mark.skipif(bool(meshes.missing()), reason="; ".join(meshes.missing()))


@pytest.fixture(scope="module")
def dressed() -> mujoco.MjModel:
    return ROBOT.model("play")


@pytest.fixture
def without(monkeypatch):
    """Call it with the names of packages that shall not be there."""
    real = importlib.util.find_spec

    def hide(*modules: str) -> None:
        monkeypatch.setattr(importlib.util, "find_spec", lambda name, *rest: None if name in modules else real(name, *rest))

    return hide


def visual(model: mujoco.MjModel) -> np.ndarray:
    return np.flatnonzero(model.geom_group == meshes.VISUAL_GROUP)


def links_in_sight(model: mujoco.MjModel) -> set[str]:
    return {model.body(model.geom_bodyid[g]).name for g in visual(model)}


def corners(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """Box around a mesh in the frame of its link: lower and upper corner [2, 3], m."""
    at = model.geom_dataid[geom]
    vertices = model.mesh_vert[model.mesh_vertadr[at] : model.mesh_vertadr[at] + model.mesh_vertnum[at]]
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
    placed = vertices @ turn.reshape(3, 3).T + model.geom_pos[geom]
    return np.array([placed.min(axis=0), placed.max(axis=0)])


def test_every_link_is_seen_and_nothing_seen_collides_or_weighs(dressed):
    assert links_in_sight(dressed) == {body.name for body in H1.bodies}
    for array in (dressed.geom_contype, dressed.geom_conaffinity):
        assert not array[visual(dressed)].any()
    seen = {dressed.geom(g).name for g in visual(dressed)}
    paired = {dressed.geom(g).name for g in np.r_[dressed.pair_geom1, dressed.pair_geom2]}
    assert not (seen & paired - {""})


@needs_meshes
def test_the_page_has_a_moderate_number_of_triangles_to_stream(dressed):
    assert 80_000 < dressed.nmeshface < 120_000


@needs_meshes
def test_meshes_sit_on_their_links(dressed):
    """Every link's origin, its joint, lies in or just beside the box around its mesh; the logo has no joint."""
    checked = 0
    for geom in visual(dressed):
        if dressed.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH:
            continue
        if "logo" in dressed.mesh(dressed.geom_dataid[geom]).name:
            continue
        low, high = corners(dressed, geom)
        assert (low < 0.01).all(), dressed.mesh(dressed.geom_dataid[geom]).name
        assert (high > -0.01).all(), dressed.mesh(dressed.geom_dataid[geom]).name
        checked += 1
    assert checked == 22 + 26  # body and hands


@needs_meshes
def test_left_meshes_mirror_right_ones(dressed):
    boxes = {
        dressed.mesh(dressed.geom_dataid[g]).name: corners(dressed, g)
        for g in visual(dressed)
        if dressed.geom_type[g] == mujoco.mjtGeom.mjGEOM_MESH
    }
    pairs = [(name, name.replace("left", "right")) for name in boxes if name.startswith("left")]
    assert len(pairs) == 10
    for left, right in pairs:
        (x0, y0, z0), (x1, y1, z1) = boxes[left]
        np.testing.assert_allclose(boxes[right], [(x0, -y1, z0), (x1, -y0, z1)], atol=2e-3, err_msg=left)


@needs_meshes
def test_the_feet_stand_where_the_soles_touch(dressed):
    spheres = [g for g in range(dressed.ngeom) if dressed.geom(g).name.startswith("left_sole_")]
    touch = dressed.geom_pos[spheres] - [0, 0, 0.01]
    foot = next(g for g in visual(dressed) if dressed.geom(g).bodyid == dressed.body("left_ankle_roll_link").id)
    low, high = corners(dressed, foot)
    assert low[2] == pytest.approx(touch[0, 2], abs=2e-3)
    assert (low[:2] < touch[:, :2].min(axis=0)).all()
    assert (high[:2] > touch[:, :2].max(axis=0)).all()


@pytest.mark.parametrize(
    "hidden", [("robosuite_models", "fourier_robot_descriptions"), ("robosuite_models",), ("fourier_robot_descriptions",)]
)
def test_without_packages_plain_shapes_stand_for_the_links_and_somebody_is_told(without, hidden):
    without(*hidden)
    model = ROBOT.model("play")
    assert links_in_sight(model) == {body.name for body in H1.bodies}
    told = ROBOT.missing()
    assert ("pip install robosuite-models==1.0.0" in " ".join(told)) == ("robosuite_models" in hidden)
    assert ("pip install --no-deps fourier-robot-descriptions==0.2.7" in " ".join(told)) == ("fourier_robot_descriptions" in hidden)
    if len(hidden) == 2:
        assert model.nmesh == 0
        assert len(told) == 2


@needs_meshes
def test_nothing_is_missing_when_both_packages_are_there():
    assert meshes.missing() == []


@needs_meshes
def test_looks_do_not_change_how_the_robot_moves(without, dressed):
    without("robosuite_models", "fourier_robot_descriptions")
    plain = ROBOT.model("play")
    ends = []
    for model in (dressed, plain):
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
        mujoco.mj_step(model, data, nstep=100)
        ends.append(data.qpos.copy())
    np.testing.assert_array_equal(*ends)


@needs_meshes
def test_the_head_camera_sees_past_its_own_head(dressed):
    """A ray from each eye along its view meets nothing of the robot when it looks at the horizon."""
    data = mujoco.MjData(dressed)
    mujoco.mj_forward(dressed, data)
    for eye in ("left_eye", "right_eye", "head"):
        start, ahead = data.camera(eye).xpos, -data.camera(eye).xmat.reshape(3, 3)[:, 2]
        np.testing.assert_allclose(ahead, (1, 0, 0), atol=1e-9)
        hit = np.full(1, -1, dtype=np.int32)
        for tilt in (-0.5, 0.0, 0.5):
            direction = np.array([np.cos(tilt), 0, np.sin(tilt)])
            far = mujoco.mj_ray(dressed, data, start, direction, np.array([0, 0, 1, 0, 0, 0], dtype=np.uint8), 1, -1, hit)
            assert far == -1
