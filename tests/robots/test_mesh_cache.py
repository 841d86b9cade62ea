"""Simplified meshes and the file that keeps them."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import trimesh

from robots.mesh_cache import Mesh, Source, load


@pytest.fixture
def ball(tmp_path: Path) -> Path:
    """A ball of 1 m around the origin, 5120 triangles."""
    path = tmp_path / "ball.STL"
    trimesh.creation.icosphere(subdivisions=4, radius=1.0).export(path)
    return path


@pytest.fixture
def kept(tmp_path: Path, monkeypatch) -> Path:
    """Where the cache lies."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "humanoid-teleop"


def same(one: dict[str, Mesh], two: dict[str, Mesh]) -> bool:
    return one.keys() == two.keys() and all(np.array_equal(a, b) for k in one for a, b in zip(one[k], two[k], strict=True))


def test_a_mesh_keeps_its_share_of_triangles_and_its_shape(ball, kept):
    mesh = load({"ball": Source(ball, keep=0.3)}, "test")["ball"]
    assert len(mesh.faces) == pytest.approx(0.3 * 5120, rel=0.02)
    radius = np.linalg.norm(mesh.vertices, axis=1)
    assert radius.min() > 0.98
    assert radius.max() < 1.02
    assert mesh.faces.max() < len(mesh.vertices)


def test_small_meshes_stay_whole(ball, kept):
    mesh = load({"ball": Source(ball, keep=0.01, floor=9999)}, "test")["ball"]
    assert len(mesh.faces) == 5120


def test_a_mesh_is_cut_then_scaled_then_moved(ball, kept):
    mesh = load({"ball": Source(ball, cut=(0.0, 0.5), scale=(2, 1, 1), shift=(0, 0, 3))}, "test")["ball"]
    np.testing.assert_allclose(mesh.vertices.min(axis=0), (0, -1, 2), atol=0.01)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), (1, 1, 4), atol=0.01)


def test_a_second_load_reads_the_cache(ball, kept):
    sources = {"ball": Source(ball)}
    first = load(sources, "test")
    (file,) = kept.iterdir()
    np.savez(file, **{"ball.vertices": np.zeros((3, 3)), "ball.faces": np.array([[0, 1, 2]])})
    assert load(sources, "test")["ball"].vertices.shape == (3, 3)
    file.unlink()
    assert same(load(sources, "test"), first)


def test_another_source_or_recipe_has_another_file(ball, kept):
    load({"ball": Source(ball)}, "test")
    load({"ball": Source(ball, keep=0.5)}, "test")
    trimesh.creation.icosphere(subdivisions=3, radius=2.0).export(ball)
    other = load({"ball": Source(ball)}, "test")["ball"]
    assert other.vertices.max() == pytest.approx(2.0, abs=0.01)
    assert len(list(kept.iterdir())) == 3


@pytest.mark.parametrize("damage", [b"", b"not a zip", None])
def test_a_damaged_file_is_made_anew(ball, kept, damage, caplog):
    sources = {"ball": Source(ball)}
    first = load(sources, "test")
    (file,) = kept.iterdir()
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2] if damage is None else damage)
    assert same(load(sources, "test"), first)
    assert "damaged" in caplog.text
    assert same(load(sources, "test"), first)
    assert file.stat().st_size == len(whole)


def test_without_a_place_to_write_meshes_are_still_there(ball, tmp_path, monkeypatch, caplog):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert len(load({"ball": Source(ball)}, "test")["ball"].faces) > 1000
    assert "every start" in caplog.text


def test_many_may_start_together(ball, kept):
    sources = {"ball": Source(ball, keep=0.5)}
    with ThreadPoolExecutor(4) as pool:
        results = list(pool.map(lambda _: load(sources, "test"), range(4)))
    assert all(same(result, results[0]) for result in results)
    (file,) = kept.iterdir()
    assert file.suffix == ".npz"
