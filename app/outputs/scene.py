"""The static part of the 3D picture: robot, floor, wrist handles, ghosts. The page moves it, from the qpos it is sent."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import viser

from app.outputs import geometry, shapes
from app.outputs.description import BODIES, PELVIS, SceneDescription, SceneWrist, describe
from robots.spec import RobotSpec

GHOST_FACES = 3000
"""Triangles of a ghost hand."""
GHOST_RGB = (255, 176, 46)
EXPECTED_RGB = (118, 72, 240)
BEADS = 10
"""Of the way that the motion prior expects a wrist to go: one for each 0.1 s."""
BEAD_SIZE, BEAD_OPACITY = (0.018, 0.009), (0.95, 0.35)
"""Of the nearest and the farthest: radius [m] and opacity."""
HANDLE_SIZE = 0.15
"""Length of a handle's arrows [m]."""
SIDES = ("left", "right")


def build(server: viser.ViserServer, spec: RobotSpec, model: mujoco.MjModel, found: list[geometry.Look]) -> SceneDescription:
    """Put a robot's play model, with the looks `found` of it, into viser's scene and describe it to the page.

    Poses in the scene stay what they are here: every page applies the newest ones itself (web/stage.js), so that a slow or
    hidden page costs nothing and each page has its own view.
    """
    surroundings(server)
    drawn = sorted({look.body for look in found} | {model.body("pelvis").id})
    for body in drawn:
        server.scene.add_frame(BODIES + model.body(body).name, show_axes=False)
    for index, look in enumerate(found):
        _mesh(server, f"{BODIES}{model.body(look.body).name}/look_{index}", look)
    wrists = [_wrist(server, model, found, side, site) for side, site in zip(SIDES, spec.wrists, strict=True)]
    return describe(spec, model, [model.body(body).name for body in drawn], wrists)


def surroundings(server: viser.ViserServer) -> None:
    """Floor and light; the page colours them for its light or dark theme."""
    scene = server.scene
    scene.world_axes.visible = False
    scene.add_grid(
        "/floor", infinite_grid=True, cell_size=0.5, section_size=1.0, fade_distance=14.0, fade_strength=1.4, cell_thickness=0.6,
        section_thickness=0.9, shadow_opacity=0.35, plane_opacity=1.0,
    )  # fmt: skip
    scene.configure_environment_map(hdri=None)  # light from pictures takes a browser without a graphics processor a minute to set up
    scene.add_light_hemisphere("/sky", sky_color=(255, 255, 255), ground_color=(170, 174, 182), intensity=3.6)
    scene.configure_default_lights(enabled=True, cast_shadow=True)
    server.gui.configure_theme(show_logo=False, show_share_button=False, control_layout="floating")


def _mesh(server: viser.ViserServer, name: str, look: geometry.Look) -> None:
    server.scene.add_mesh_simple(name, look.vertices, look.faces, color=look.rgb)


def _wrist(server: viser.ViserServer, model: mujoco.MjModel, found: list[geometry.Look], side: str, site: str) -> SceneWrist:
    """Handle, ghost hands with a label, beads; below the pelvis so that they walk with the robot."""
    handle, ghost, expected = (f"{PELVIS}/{side}_{what}" for what in ("handle", "ghost", "expected"))
    ahead = tuple(f"{PELVIS}/{side}_ahead_{i}" for i in range(BEADS))
    scene = server.scene
    scene.add_transform_controls(handle, scale=HANDLE_SIZE, line_width=3.0, depth_test=False, opacity=0.9, disable_sliders=True)
    hand = model.body(int(model.site(site).bodyid[0])).name
    vertices, faces = geometry.subtree(model, found, hand, site, GHOST_FACES)
    glassy: dict[str, Any] = {"cast_shadow": False, "receive_shadow": False, "visible": False}
    scene.add_mesh_simple(ghost, vertices, faces, color=GHOST_RGB, opacity=0.4, **glassy)
    scene.add_mesh_simple(expected, vertices, faces, color=EXPECTED_RGB, opacity=0.4, **glassy)
    sphere, rgb = shapes.surface(mujoco.mjtGeom.mjGEOM_SPHERE, np.ones(3)), EXPECTED_RGB
    for bead, size, opacity in zip(ahead, np.linspace(*BEAD_SIZE, BEADS), np.linspace(*BEAD_OPACITY, BEADS), strict=True):
        scene.add_mesh_simple(bead, *sphere, scale=float(size), color=rgb, opacity=float(opacity), **glassy)
    scene.add_label(f"{ghost}/reason", "", position=(0, 0, 0.14), anchor="bottom-center", visible=False)
    return SceneWrist(handle=handle, ghost=ghost, reason=f"{ghost}/reason", ahead=ahead, expected=expected)
