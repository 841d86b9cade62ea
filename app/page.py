"""Everything that a browser sees: viser's page, our overlay, the robot in it."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
from fastapi import APIRouter

from app import relay, viewer
from app.outputs import geometry, live, meshes, scene
from robots.spec import RobotSpec


class Page:
    """The page of one robot."""

    def __init__(self, spec: RobotSpec, model: mujoco.MjModel, newest: Callable[[], np.void]) -> None:
        """Start viser and fill its scene.

        Args:
            spec: of the robot.
            model: what is shown: its play model.
            newest: the newest snapshot (app.shared.snapshot_dtype).

        Raises:
            UnknownViewer, BrokenPage: the installation does not fit.
        """
        client = viewer.client_page()
        self._viser = viewer.start()
        looks = geometry.looks(model)
        description = scene.build(self._viser, spec, model, looks)
        self.routers: tuple[APIRouter, ...] = (
            relay.page_router(self._viser.get_port(), client),
            live.router(description, newest),
            meshes.router(looks),
        )

    def close(self) -> None:
        """Stop viser."""
        viewer.stop(self._viser)
