"""Builds the H1's MuJoCo model from its table, in a training and a play variant.

Both share bodies, motors, foot contacts and self-collision pairs. Training welds hands and neck (their mass stays);
play moves every joint, shows meshes where they are installed, and lets a fallen robot lie on the floor.
"""

from __future__ import annotations

import itertools

import mujoco
import numpy as np

from robots.catalog import Variant
from robots.h1 import meshes
from robots.h1.spec import EYES, FINGERTIPS, H1, SOLE_SPHERES
from robots.spec import Joint

TIMESTEP = 0.005
"""Physics step [s]; four make one policy tick."""

CAMERA_QUAT = (0.5, 0.5, -0.5, -0.5)
"""Turns MuJoCo's camera (looks along -z) to look along the body's +x with +z up."""

# Capsules (body, from, to, radius [m]) that stand for a link in collisions and, without meshes, on screen.
_LEG = {
    "thigh": ("hip_pitch_link", (0, 0, -0.06), (0, 0, -0.36), 0.065),
    "shank": ("knee_link", (0, 0, -0.04), (0, 0, -0.36), 0.05),
    "foot": ("ankle_roll_link", (-0.06, 0, -0.02), (0.16, 0, -0.02), 0.03),
}
_ARM = {
    "upper_arm": ("shoulder_yaw_link", (0, 0, 0.02), (0.01, 0, -0.18), 0.045),
    "elbow": ("elbow_pitch_link", (0, 0, 0), (0.12, 0, -0.015), 0.04),
    "forearm": ("elbow_roll_link", (0, 0, 0), (0.085, 0, 0), 0.038),
    "palm": ("wrist_yaw_link", (0.06, 0, 0), (0.15, 0, 0), 0.035),
    "fingers": ("wrist_yaw_link", (0.17, 0, 0), (0.23, 0, 0), 0.025),
}
_TRUNK = {
    "pelvis": ("pelvis", (0, -0.06, -0.1), (0, 0.06, -0.1), 0.08),
    "torso": ("torso_link", (0, 0, 0.1), (0, 0, 0.47), 0.115),
    "head": ("torso_link", (0.02, 0, 0.64), (0.02, 0, 0.7), 0.085),
}
# Capsules of a left finger's links as above; on the right y changes sign.
_FINGERS = {
    "thumb_proximal": ((0.004, 0, -0.008), (0.044, -0.032, -0.008), 0.009),
    "thumb_intermediate": ((0, 0, -0.007), (0.02, -0.01, -0.007), 0.008),
    "thumb_distal": ((0, 0, -0.006), (0.012, -0.009, -0.005), 0.007),
} | {
    link: shape
    for finger, reach in (("index", 0.036), ("middle", 0.041), ("ring", 0.036), ("pinky", 0.028))
    for link, shape in (
        (f"{finger}_proximal", ((0, 0, -0.006), (-0.0024, -0.032, -0.006), 0.0075)),
        (f"{finger}_intermediate", ((0.002, 0, -0.005), (-0.003, -reach, -0.005), 0.006)),
    )
}
_PALM = ((0.002, -0.095, 0), (0.012, 0.04, 0.036))
"""Centre and half sizes of the box that stops fingers [m]."""
TOUCHABLE = 2
"""Bit of contype and conaffinity: palms and fingers touch one another and every other geom that has it."""


def capsules() -> dict[str, tuple[str, tuple, tuple, float]]:
    """Name -> (body, from, to, radius) of every collision capsule, both sides."""
    sided = {f"{side}_{name}": (f"{side}_{body}", a, b, r) for side in ("left", "right") for name, (body, a, b, r) in (_LEG | _ARM).items()}
    return _TRUNK | sided


def collision_pairs() -> list[tuple[str, str]]:
    """Capsules that may touch: each arm against trunk, thighs and the other arm; the legs against each other."""
    pairs = []
    for side in ("left", "right"):
        for part in ("elbow", "forearm", "palm", "fingers"):
            pairs += [(f"{side}_{part}", other) for other in ("pelvis", "torso", "head", "left_thigh", "right_thigh")]
    arm = ("upper_arm", "elbow", "forearm", "palm", "fingers")
    pairs += [(f"left_{a}", f"right_{b}") for a, b in itertools.product(arm, arm) if (a, b) != ("upper_arm", "upper_arm")]
    pairs += [("left_thigh", "right_thigh"), ("left_shank", "right_shank"), ("left_foot", "right_foot")]
    return [*pairs, ("left_foot", "right_shank"), ("left_shank", "right_foot")]


def build(variant: Variant) -> mujoco.MjSpec:
    """The H1 as an MjSpec standing in its home pose (keyframe "home") on a floor."""
    spec = mujoco.MjSpec()
    spec.modelname = f"h1_{variant}"
    _options(spec)
    bodies = _bodies(spec)
    moving = [j for j in H1.joints if variant == "play" or j.group not in ("hands", "neck")]
    for joint in moving:
        _joint(bodies, joint)
    for joint in moving:
        _motor(spec, joint)
    _contacts(spec, bodies, floor_stops_body=variant == "play")
    _senses(spec, bodies)
    if variant == "play":
        _cameras(bodies)
        _fingers(bodies)
    else:
        spec.compiler.fusestatic = True
    _home(spec, moving)
    if variant == "play":
        meshes.dress(spec, bodies, capsules())  # after `_home`, which compiles a copy
    return spec


def _options(spec: mujoco.MjSpec) -> None:
    spec.compiler.degree = False
    spec.compiler.autolimits = True
    option = spec.option
    option.timestep = TIMESTEP
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON  # CG let the robot fall at this timestep
    option.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL
    option.iterations, option.ls_iterations = 5, 8
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # a divergence must be seen, never a silent reset


def _bodies(spec: mujoco.MjSpec) -> dict[str, mujoco.MjsBody]:
    made: dict[str | None, mujoco.MjsBody] = {None: spec.worldbody}
    for row in H1.bodies:
        body = made[row.parent].add_body(name=row.name, pos=row.pos, quat=row.quat)
        body.mass, body.ipos, body.fullinertia = row.mass, row.com, row.inertia
        body.explicitinertial = True
        made[row.name] = body
    made["pelvis"].add_freejoint(name="pelvis_free")
    return {name: body for name, body in made.items() if name is not None}


def _joint(bodies: dict[str, mujoco.MjsBody], joint: Joint) -> None:
    bodies[joint.body].add_joint(
        name=joint.name,
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=joint.axis,
        range=(joint.lower, joint.upper),
        armature=joint.armature,
        damping=joint.damping,
    )


def _motor(spec: mujoco.MjSpec, joint: Joint) -> None:
    if joint.mimic:
        leader, ratio = joint.mimic
        follow = spec.add_equality(name=f"{joint.name}_follows", type=mujoco.mjtEq.mjEQ_JOINT, name1=joint.name, name2=leader)
        follow.objtype = mujoco.mjtObj.mjOBJ_JOINT
        follow.data[:2] = (0, ratio)
        return
    motor = spec.add_actuator(name=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=joint.name)
    motor.set_to_position(kp=joint.kp, kv=joint.kd)
    motor.forcerange, motor.ctrlrange = (-joint.effort, joint.effort), (joint.lower, joint.upper)


def _contacts(spec: mujoco.MjSpec, bodies: dict[str, mujoco.MjsBody], floor_stops_body: bool) -> None:
    floor = spec.worldbody.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 0.05), contype=1, conaffinity=0, condim=3, friction=(0.9, 0.005, 0.0001)
    )
    floor.rgba = (0.55, 0.58, 0.62, 1)
    for side in ("left", "right"):
        for i, centre in enumerate(SOLE_SPHERES):
            bodies[f"{side}_ankle_roll_link"].add_geom(
                name=f"{side}_sole_{i}", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(0.01, 0, 0), pos=centre, contype=0, conaffinity=1,
                condim=3, friction=(0.9, 0.005, 0.0001), mass=0, group=4,
            )  # fmt: skip
    for name, (body, start, end, radius) in capsules().items():
        bodies[body].add_geom(
            name=name, type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=(*start, *end), size=(radius, 0, 0), contype=0, conaffinity=0, mass=0,
            group=3, rgba=(0.2, 0.22, 0.25, 1),
        )  # fmt: skip
    for one, other in collision_pairs():
        spec.add_pair(geomname1=one, geomname2=other, condim=1)
    if floor_stops_body:
        for name in capsules():
            if not name.endswith("_foot"):
                spec.add_pair(geomname1="floor", geomname2=name, condim=3)


def _senses(spec: mujoco.MjSpec, bodies: dict[str, mujoco.MjsBody]) -> None:
    site, sensor = mujoco.mjtObj.mjOBJ_SITE, mujoco.mjtSensor
    bodies["torso_link"].add_site(name="imu", pos=(-0.04452, -0.01891, 0.27756), group=4)
    for name, kind in (("gyro", sensor.mjSENS_GYRO), ("accelerometer", sensor.mjSENS_ACCELEROMETER)):
        spec.add_sensor(name=f"imu_{name}", type=kind, objtype=site, objname="imu")
    spec.add_sensor(name="imu_quaternion", type=sensor.mjSENS_FRAMEQUAT, objtype=site, objname="imu")
    for side in ("left", "right"):
        bodies[f"{side}_ankle_roll_link"].add_site(
            name=f"{side}_sole", pos=(0.0485, 0, -0.05), type=mujoco.mjtGeom.mjGEOM_BOX, size=(0.16, 0.06, 0.03), group=4
        )
        bodies[f"{side}_wrist_yaw_link"].add_site(name=f"{side}_wrist", pos=(0.0365, 0, 0), group=4)
    body = mujoco.mjtObj.mjOBJ_XBODY  # the link frame; mjOBJ_BODY would be its inertial frame
    for foot in H1.feet:
        spec.add_sensor(name=f"{foot}_touch", type=sensor.mjSENS_TOUCH, objtype=site, objname=foot)
        in_pelvis = {"objtype": site, "objname": foot, "reftype": body, "refname": "pelvis"}
        spec.add_sensor(name=f"{foot}_in_pelvis", type=sensor.mjSENS_FRAMEPOS, **in_pelvis)
        spec.add_sensor(name=f"{foot}_velocity_in_pelvis", type=sensor.mjSENS_FRAMELINVEL, **in_pelvis)


def _cameras(bodies: dict[str, mujoco.MjsBody]) -> None:
    for eye, pos in EYES.items():
        bodies["neck_pitch_link"].add_camera(name=f"{eye}_eye", pos=pos, quat=CAMERA_QUAT, fovy=70)
    bodies["neck_pitch_link"].add_camera(name="head", pos=(0.045, 0, 0.012), quat=CAMERA_QUAT, fovy=70)


def _fingers(bodies: dict[str, mujoco.MjsBody]) -> None:
    """What fingers touch with, and the sites at their tips."""
    touch = {
        "contype": TOUCHABLE, "conaffinity": TOUCHABLE, "condim": 4, "friction": (1.0, 0.01, 0.0001), "mass": 0, "group": 3,
        "rgba": (0.2, 0.22, 0.25, 1),
    }  # fmt: skip
    for side, sign in (("L", 1), ("R", -1)):
        centre, half = _PALM
        bodies[f"{side}_hand_base_link"].add_geom(name=f"{side}_palm", type=mujoco.mjtGeom.mjGEOM_BOX, pos=centre, size=half, **touch)
        for link, ((ax, ay, az), (bx, by, bz), radius) in _FINGERS.items():
            ends = (ax, sign * ay, az, bx, sign * by, bz)
            bodies[f"{side}_{link}"].add_geom(
                name=f"{side}_{link}", type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=ends, size=(radius, 0, 0), **touch
            )
        for finger, (link, (x, y, z)) in FINGERTIPS.items():
            bodies[f"{side}_{link}"].add_site(name=f"{side}_{finger}_tip", pos=(x, sign * y, z), group=4)


def _home(spec: mujoco.MjSpec, moving: list[Joint]) -> None:
    """Key frame "home": soles on the floor, every joint at its default."""
    model = spec.copy().compile()  # compiling twice the spec that fuses bodies crashes MuJoCo 3.14
    data = mujoco.MjData(model)
    data.qpos[3] = 1.0
    for joint in moving:
        data.qpos[model.joint(joint.name).qposadr[0]] = joint.home
    data.qpos[2] = 0.0
    mujoco.mj_kinematics(model, data)
    data.qpos[2] = -min(data.site(foot).xpos[2] for foot in H1.feet)
    ctrl = np.array([j.home for j in moving if j.mimic is None])
    spec.add_key(name="home", qpos=data.qpos.copy(), qvel=np.zeros(model.nv), ctrl=ctrl)
