"""Draws what cameras saw from recorded joint positions, in processes of their own: software drawing is slow."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import tempfile
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import TracebackType

import mujoco
import numpy as np

from app.exports import cameras
from app.exports.demonstration import kinematics
from app.exports.errors import ExportError, NoPictures

BACKENDS = ("egl", "osmesa", "glfw")
"""Values of MUJOCO_GL that are tried on Linux: a graphics processor, software, a screen."""
BLOCK = 16
"""Rows that a process draws at once."""
PROBE = "import mujoco; mujoco.Renderer(mujoco.MjModel.from_xml_string('<mujoco><worldbody/></mujoco>'), 16, 16).render()"

GRID, LINES = 0.5, 24
"""Distance of the floor's lines [m], and how many in each direction."""


@dataclass(frozen=True)
class Scenery:
    """What to draw; travels to the drawing processes."""

    model: Path
    """Compiled model (MJB)."""
    cameras: tuple[str, ...]
    """`app.exports.cameras.NAMES`."""
    size: tuple[int, int]
    """Width and height."""
    wrists: tuple[str, str]
    """Names of the wrist sites."""


class Painter:
    """Draws in as many processes as there are processors, in a `with` statement."""

    def __init__(self, model: mujoco.MjModel, chosen: tuple[str, ...], size: tuple[int, int], wrists: tuple[str, str]) -> None:
        """Arguments as in `Scenery`.

        Raises:
            NoPictures: MuJoCo finds no way to draw.
        """
        os.environ["MUJOCO_GL"] = backend()  # the processes inherit it
        self._folder = tempfile.TemporaryDirectory()
        self._scenery = Scenery(Path(self._folder.name) / "model.mjb", chosen, size, wrists)
        mujoco.mj_saveModel(model, str(self._scenery.model), None)
        self._workers = os.cpu_count() or 1
        self._pool = ProcessPoolExecutor(self._workers, multiprocessing.get_context("spawn"))

    def __enter__(self) -> Painter:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._pool.shutdown(cancel_futures=True)
        self._folder.cleanup()

    def frames(self, qpos: np.ndarray) -> Iterator[np.ndarray]:
        """What every camera sees at each row of qpos [n, nq]: [cameras, height, width, 3] uint8, one row after the other.

        Raises:
            ExportError: a drawing process died.
        """
        waiting: deque[Future[np.ndarray]] = deque()
        try:
            for start in range(0, len(qpos), BLOCK):
                waiting.append(self._pool.submit(_draw, self._scenery, qpos[start : start + BLOCK]))
                if len(waiting) > self._workers + 1:
                    yield from waiting.popleft().result()
            while waiting:
                yield from waiting.popleft().result()
        except BrokenProcessPool as error:
            raise ExportError("a drawing process died; try a smaller --size, another MUJOCO_GL, or --cameras none") from error


@cache
def backend() -> str:
    """The value of MUJOCO_GL with which MuJoCo draws here; "" is MuJoCo's own choice.

    Raises:
        NoPictures: there is none.
    """
    asked = os.environ.get("MUJOCO_GL")
    candidates = (asked,) if asked else BACKENDS if sys.platform == "linux" else ("",)
    working = next((candidate for candidate in candidates if _draws(candidate)), None)
    if working is None:
        raise NoPictures(candidates)
    return working


def _draws(backend: str) -> bool:
    environment = {name: value for name, value in os.environ.items() if name != "PYOPENGL_PLATFORM"} | {"MUJOCO_GL": backend}
    with tempfile.TemporaryDirectory() as aside:  # MuJoCo leaves MUJOCO_LOG.TXT where it failed
        try:
            done = subprocess.run([sys.executable, "-c", PROBE], env=environment, capture_output=True, timeout=60, cwd=aside)
        except subprocess.TimeoutExpired:
            return False
    return done.returncode == 0


def _draw(scenery: Scenery, qpos: np.ndarray) -> np.ndarray:
    canvas = _canvas(scenery)
    return np.stack([canvas.paint(row) for row in qpos])


@cache
def _canvas(scenery: Scenery) -> _Canvas:
    return _Canvas(scenery)


class _Canvas:
    """MuJoCo's renderer with light, sky and a floor on which motion can be seen."""

    def __init__(self, scenery: Scenery) -> None:
        self._scenery = scenery
        self._model = model = mujoco.MjModel.from_binary_path(str(scenery.model))
        model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:] = 0.45, 0.6
        model.vis.global_.offwidth, model.vis.global_.offheight = scenery.size
        self._data = mujoco.MjData(model)
        self._renderer = mujoco.Renderer(model, scenery.size[1], scenery.size[0], max_geom=model.ngeom + 2 * LINES + 10)
        self._renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0
        self._renderer.scene.flags[mujoco.mjtRndFlag.mjRND_CULL_FACE] = 0

    def paint(self, qpos: np.ndarray) -> np.ndarray:
        """[cameras, height, width, 3]"""
        kinematics(self._model, self._data, qpos)
        self._renderer.update_scene(self._data)
        self._surroundings(self._data.xpos[1])
        return np.stack([self._look(name) for name in self._scenery.cameras])

    def _look(self, name: str) -> np.ndarray:
        seen = cameras.view(name, self._model, self._data, self._scenery.wrists)
        scene = self._renderer.scene
        for eye in scene.camera:
            eye.pos, eye.forward, eye.up = seen.position, seen.forward, seen.up
            eye.frustum_center = eye.frustum_width = 0.0
            eye.frustum_near, eye.frustum_far = 0.02, 100.0
            eye.frustum_top = eye.frustum_near * np.tan(seen.fov / 2)
            eye.frustum_bottom = -eye.frustum_top
        scene.lights[0].pos, scene.lights[0].dir = seen.position, seen.forward
        return self._renderer.render()

    def _surroundings(self, pelvis: np.ndarray) -> None:
        turn, across = np.eye(3).ravel(), GRID * LINES / 2
        centre = np.round(pelvis[:2] / GRID) * GRID
        self._add(mujoco.mjtGeom.mjGEOM_SPHERE, (40, 0, 0), (*centre, 0), turn, (0.72, 0.8, 0.88, 1), emission=0.6)
        for i in range(LINES):
            aside = (i - LINES // 2) * GRID
            for size, at in (((across, 0.006, 2e-4), (0, aside)), ((0.006, across, 2e-4), (aside, 0))):
                self._add(mujoco.mjtGeom.mjGEOM_BOX, size, (*(centre + at), 0), turn, (0.35, 0.37, 0.4, 1))

    def _add(self, kind: mujoco.mjtGeom, size: tuple, position: tuple, turn: np.ndarray, rgba: tuple, emission: float = 0.0) -> None:
        scene = self._renderer.scene
        geom = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(geom, kind, np.array(size, float), np.array(position, float), turn, np.array(rgba, np.float32))
        geom.emission = emission
        scene.ngeom += 1
