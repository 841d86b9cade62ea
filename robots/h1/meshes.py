"""What the H1 looks like in the play model: meshes of installed data packages, primitives where there are none.

No mesh is kept in this repository. `README.md` beside this file says where each comes from, NOTICE.md under which terms.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import mujoco

from robots.h1.spec import EYES, FINGERTIPS, H1
from robots.mesh_cache import Mesh, Source, load
from robots.spec import Vec

Capsules = dict[str, tuple[str, tuple, tuple, float]]
"""Name -> (link, from, to, radius), m, in the link's frame."""

VISUAL_GROUP = 2
"""Geom group of everything drawn; collision capsules are in 3, soles in 4."""

Rgba = tuple[float, float, float, float]
BLACK, METAL, GREY, WHITE = (0.13, 0.135, 0.15, 1), (0.30, 0.31, 0.34, 1), (0.62, 0.63, 0.66, 1), (0.9, 0.9, 0.92, 1)


@dataclass(frozen=True)
class Package:
    """A data package on PyPI that carries meshes. Its code is never imported."""

    module: str
    requirement: str
    folder: str
    """Folder of the meshes in the package."""
    draws: str
    """What stays plain without it."""
    keep: float
    """Share of a mesh's triangles that is drawn. Both packages together are then about 113 thousand."""
    flags: str = ""
    """What `pip install` needs beside the requirement."""

    def installed(self) -> dict[str, Path]:
        """File name -> path of the package's meshes; empty if it is not installed."""
        found = importlib.util.find_spec(self.module)
        folder = Path(found.origin).parent / self.folder if found and found.origin else None
        return {path.name: path for path in folder.glob("*.STL")} if folder else {}

    def needs(self) -> set[str]:
        """Names of the files that the H1 shows."""
        return {part.file for part in PARTS if part.package is self}


BODY = Package("robosuite_models", "robosuite-models==1.0.0", "assets/robots/h1/meshes", "the body", keep=0.28)
HANDS = Package(
    "fourier_robot_descriptions",
    "fourier-robot-descriptions==0.2.7",
    "assets/meshes/inspire_hand",
    "each hand",
    keep=0.15,
    # its code wants a C++ dynamics library that the meshes do not need
    flags="--no-deps ",
)


@dataclass(frozen=True)
class Part:
    """One mesh on one link."""

    link: str
    package: Package
    file: str
    rgba: Rgba
    cut: tuple[float, float] | None = None
    """As in `Source`; so are scale and shift."""
    scale: tuple[float, float, float] = (1, 1, 1)
    shift: tuple[float, float, float] = (0, 0, 0)

    @property
    def name(self) -> str:
        return f"{self.link}_{Path(self.file).stem}"


_FINGER_LINKS = (
    "thumb_proximal_base", "thumb_proximal", "thumb_intermediate", "thumb_distal", "index_proximal", "index_intermediate",
    "middle_proximal", "middle_intermediate", "ring_proximal", "ring_intermediate", "pinky_proximal", "pinky_intermediate",
)  # fmt: skip
"""In the order of the package's files Link11 to Link22."""


def _parts() -> Iterator[Part]:
    yield Part("pelvis", BODY, "pelvis.STL", METAL)
    yield Part("torso_link", BODY, "torso_link.STL", BLACK)
    yield Part("torso_link", BODY, "logo_link.STL", WHITE)
    for side in ("left", "right"):
        for link in ("hip_yaw", "hip_roll", "shoulder_pitch", "shoulder_roll"):
            yield Part(f"{side}_{link}_link", BODY, f"{side}_{link}_link.STL", METAL)
        for link in ("hip_pitch", "knee", "shoulder_yaw"):
            yield Part(f"{side}_{link}_link", BODY, f"{side}_{link}_link.STL", BLACK)
        # the package's H1 has one ankle axis and one elbow axis: its foot is stretched to this one's sole, its forearm cut in two
        yield Part(f"{side}_ankle_roll_link", BODY, f"{side}_ankle_link.STL", METAL, scale=(1.25, 1.2, 1), shift=(-0.019, 0, 0.02))
        elbow = f"{side}_elbow_link.STL"
        yield Part(f"{side}_elbow_pitch_link", BODY, elbow, METAL, cut=(-1, 0.121))
        yield Part(f"{side}_elbow_roll_link", BODY, elbow, BLACK, cut=(0.121, 0.262), scale=(0.6, 1, 1), shift=(-0.0726, 0, 0.015))
    for side in ("l", "r"):
        yield Part(f"{side.upper()}_hand_base_link", HANDS, f"base_link_{side}.STL", GREY)
        for number, link in enumerate(_FINGER_LINKS, start=11):
            yield Part(f"{side.upper()}_{link}", HANDS, f"Link{number}_{side}.STL", GREY)


PARTS = tuple(_parts())

_PRIMITIVES: tuple[tuple[str, Rgba, float, Vec, Vec], ...] = (
    ("ankle_pitch_link", METAL, 0.022, (0, -0.03, 0), (0, 0.03, 0)),
    ("wrist_pitch_link", METAL, 0.029, (0, -0.03, 0), (0, 0.03, 0)),
    ("wrist_yaw_link", METAL, 0.027, (0, 0, 0), (0.04, 0, 0)),
)
"""Cylinders of links without a mesh: link without its side, colour, radius [m], ends [m]."""


def missing() -> list[str]:
    """One sentence for each data package that is not installed: what it draws and how to install it."""
    plain = [package for package in (BODY, HANDS) if package.needs() - package.installed().keys()]
    return [f"no meshes for {p.draws}, so it is drawn plainly; to get them run: pip install {p.flags}{p.requirement}" for p in plain]


def dress(spec: mujoco.MjSpec, bodies: dict[str, mujoco.MjsBody], capsules: Capsules) -> None:
    """Give every link a visible shape: its mesh if that is installed, else its capsules, else bones to the next joints."""
    dressed = _add_primitives(bodies)
    for package in (BODY, HANDS):
        files = package.installed()
        parts = {part.name: part for part in PARTS if part.package is package and part.file in files}
        sources = {name: Source(files[p.file], p.cut, p.scale, p.shift, package.keep) for name, p in parts.items()}
        for name, mesh in load(sources, f"{H1.name}-{package.module}").items() if sources else ():
            _add_mesh(spec, bodies[parts[name].link], name, mesh, parts[name].rgba)
            dressed.add(parts[name].link)
    _add_plain_shapes(bodies, set(bodies) - dressed, capsules)


def _visible(body: mujoco.MjsBody, kind: mujoco.mjtGeom, rgba: Rgba, **shape: object) -> None:
    body.add_geom(type=kind, rgba=rgba, contype=0, conaffinity=0, mass=0, group=VISUAL_GROUP, **shape)


def _add_mesh(spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, mesh: Mesh, rgba: Rgba) -> None:
    asset = spec.add_mesh(name=name, uservert=mesh.vertices.ravel(), userface=mesh.faces.ravel())
    asset.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # cut meshes are open; links have their own inertia anyway
    _visible(body, mujoco.mjtGeom.mjGEOM_MESH, rgba, meshname=name)


def _add_primitives(bodies: dict[str, mujoco.MjsBody]) -> set[str]:
    """Draw ankle and wrist axes and the camera head; return the links that these stand for."""
    links = {"neck_yaw_link", "neck_pitch_link"}
    for side in ("left", "right"):
        for link, rgba, radius, start, end in _PRIMITIVES:
            _cylinder(bodies[f"{side}_{link}"], rgba, radius, start, end)
            links.add(f"{side}_{link}")
    _cylinder(bodies["neck_yaw_link"], METAL, 0.016, (0, 0, -0.03), (0, 0, 0.03))
    head = bodies["neck_pitch_link"]
    _visible(head, mujoco.mjtGeom.mjGEOM_BOX, METAL, size=(0.015, 0.062, 0.019), pos=(0.022, 0, 0.012))
    for x, y, z in EYES.values():
        _cylinder(head, BLACK, 0.013, (x - 0.02, y, z), (x - 0.003, y, z))  # ends behind the camera
    return links


def _add_plain_shapes(bodies: dict[str, mujoco.MjsBody], links: set[str], capsules: Capsules) -> None:
    """Draw links that have no mesh."""
    with_capsule = {link for link, *_ in capsules.values()} & links
    for link, start, end, radius in capsules.values():
        if link in with_capsule:
            _capsule(bodies[link], BLACK, radius, start, end)
    for link in sorted(links - with_capsule):  # sorted: every process builds the same model
        rgba, radius = _bone(link)
        for end in _next_joints(link):
            _capsule(bodies[link], rgba, radius, (0, 0, 0), end)


def _bone(link: str) -> tuple[Rgba, float]:
    """Colour and radius [m] of the bones that stand for a link."""
    if link.endswith("_hand_base_link"):
        return GREY, 0.018  # five of them side by side make a palm
    return (GREY, 0.009) if link.startswith(("L_", "R_")) else (METAL, 0.045)


def _next_joints(link: str) -> list[Vec]:
    """Where a link's children begin, or where its fingertip is [m]."""
    tips = {f"{s}_{at}": (x, y * sign, z) for s, sign in (("L", 1), ("R", -1)) for at, (x, y, z) in FINGERTIPS.values()}
    return [body.pos for body in H1.bodies if body.parent == link] or [tips[link]]


def _capsule(body: mujoco.MjsBody, rgba: Rgba, radius: float, start: Vec, end: Vec) -> None:
    _visible(body, mujoco.mjtGeom.mjGEOM_CAPSULE, rgba, size=(radius, 0, 0), fromto=(*start, *end))


def _cylinder(body: mujoco.MjsBody, rgba: Rgba, radius: float, start: Vec, end: Vec) -> None:
    _visible(body, mujoco.mjtGeom.mjGEOM_CYLINDER, rgba, size=(radius, 0, 0), fromto=(*start, *end))
