"""Episodes as pages: one HTML file each that plays in any browser, without a network and without this program."""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import msgspec
import mujoco
import numpy as np
import viser
import zstandard

from app import viewer
from app.exports.demonstration import Demonstration, Demonstrations, kinematics
from app.exports.format import Frames
from app.outputs import geometry, scene

STILL = 1e-6
"""A body that moved less in its parent's frame is not written again [m, quaternion]."""
_RECORDING = re.compile(r'window\.__VISER_EMBED_DATA__="([^"]+)"')


class Viser:
    """A folder with EPISODE.html, and EPISODE.viser for viser's own player."""

    packages: ClassVar = ()
    pictures: ClassVar = False
    fps: ClassVar = 25  # a browser draws no more of them
    tolerance: ClassVar = 2 * STILL

    def __init__(self, path: Path, demonstrations: Demonstrations, cameras: tuple[str, ...], size: tuple[int, int]) -> None:
        self._path, self._model = path, demonstrations.model
        self._data = mujoco.MjData(self._model)
        self._looks = geometry.looks(self._model)
        self._seconds = 1 / demonstrations.fps

    def add(self, demonstration: Demonstration, frames: Frames) -> None:
        """One page and its recording."""
        server = viewer.start()
        try:
            scene.surroundings(server)
            bodies = self._stand(server, demonstration.signals["qpos"][0])
            serializer = server.get_scene_serializer()
            for qpos in demonstration.signals["qpos"]:
                self._move(bodies, qpos)
                serializer.insert_sleep(self._seconds)
            page = serializer.as_html()
        finally:
            viewer.stop(server)
        self._file(demonstration, "html").write_text(page, encoding="utf-8")
        self._file(demonstration, "viser").write_bytes(_recording(page))

    def finish(self) -> None:
        """Each page stands for itself."""

    def read(self, demonstration: Demonstration) -> Mapping[str, np.ndarray]:
        """Where the pelvis is on the page at each of its times."""
        page = self._file(demonstration, "html").read_text(encoding="utf-8")
        poses, now = np.empty((len(demonstration), 7)), np.array([0.0, 0, 0, 1, 0, 0, 0])  # a node that was told nothing
        shown = _messages(_recording(page), f"/robot/{self._model.body(1).name}")
        edges = np.searchsorted([time for time, _ in shown], self._seconds * (np.arange(len(poses)) + 0.5))
        done = 0
        for row, edge in enumerate(edges):
            for _, message in shown[done:edge]:
                if "position" in message:
                    now[:3] = message["position"]
                if "wxyz" in message:
                    now[3:] = message["wxyz"]
            poses[row], done = now, edge
        return {"pelvis": poses, "frames": np.empty(0, int)}

    def _stand(self, server: viser.ViserServer, qpos: np.ndarray) -> list[viser.FrameHandle]:
        """Every body in its parent's frame, with what is drawn of it; index 0 is the first body after the world."""
        kinematics(self._model, self._data, qpos)
        names, handles = ["/robot"], []
        for body in range(1, self._model.nbody):
            position, quaternion = self._pose(body)
            names.append(f"{names[self._model.body_parentid[body]]}/{self._model.body(body).name}")
            handles.append(server.scene.add_frame(names[-1], show_axes=False, position=position, wxyz=quaternion))
        for index, look in enumerate(self._looks):
            server.scene.add_mesh_simple(f"{names[look.body]}/look_{index}", look.vertices, look.faces, color=look.rgb)
        return handles

    def _move(self, bodies: list[viser.FrameHandle], qpos: np.ndarray) -> None:
        kinematics(self._model, self._data, qpos)
        for body, handle in enumerate(bodies, start=1):
            position, quaternion = self._pose(body)
            if np.abs(position - handle.position).max() > STILL:
                handle.position = position
            if np.abs(quaternion - handle.wxyz).max() > STILL:
                handle.wxyz = quaternion

    def _pose(self, body: int) -> tuple[np.ndarray, np.ndarray]:
        """Position [m] and quaternion wxyz in the parent's frame."""
        data, parent = self._data, self._model.body_parentid[body]
        inverse, origin, position, quaternion = np.empty(4), np.empty(3), np.empty(3), np.empty(4)
        mujoco.mju_negPose(origin, inverse, data.xpos[parent], data.xquat[parent])
        mujoco.mju_mulPose(position, quaternion, origin, inverse, data.xpos[body], data.xquat[body])
        return position, quaternion

    def _file(self, demonstration: Demonstration, ending: str) -> Path:
        return self._path / f"{demonstration.info.id}.{ending}"


def _recording(page: str) -> bytes:
    found = _RECORDING.search(page)
    assert found is not None, "viser's page holds its recording"
    return base64.b64decode(found[1])


def _messages(recording: bytes, name: str) -> list[tuple[float, dict[str, Any]]]:
    """(time [s], message) of everything that is said of one node of the scene; viser 1.1.1, StateSerializer.serialize."""
    size = int.from_bytes(recording[:8], "little")
    inner = zstandard.ZstdDecompressor().decompress(recording[8:], max_output_size=size)
    packed = inner[8 : 8 + int.from_bytes(inner[:8], "little")]
    return [(time, message) for time, message in msgspec.msgpack.decode(packed)["messages"] if message.get("name") == name]
