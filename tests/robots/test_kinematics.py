"""The compiled H1 against the table it was built from, its own mirror image and its other variant."""

import mujoco
import numpy as np
import pytest

from robots import catalog
from robots.h1.spec import FINGERTIPS, H1

MIRROR = np.diag([1.0, -1.0, 1.0])
ROBOT = catalog.load("h1")


@pytest.fixture(scope="module")
def play() -> mujoco.MjModel:
    return ROBOT.model("play")


@pytest.fixture(scope="module")
def training() -> mujoco.MjModel:
    return ROBOT.model("training")


def random_angles(rng: np.random.Generator) -> dict[str, float]:
    """Every joint somewhere within its limits; those that follow, where their leader puts them."""
    angles = {j.name: rng.uniform(j.lower, j.upper) for j in H1.motors}
    return angles | {j.name: angles[j.mimic[0]] * j.mimic[1] for j in H1.joints if j.mimic}


def posed(model: mujoco.MjModel, angles: dict[str, float]) -> mujoco.MjData:
    data = mujoco.MjData(model)
    for name, angle in angles.items():
        if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) >= 0:
            data.qpos[model.joint(name).qposadr[0]] = angle
    mujoco.mj_forward(model, data)
    return data


def test_both_variants_weigh_what_the_table_says(play, training):
    table = sum(body.mass for body in H1.bodies)
    assert table == pytest.approx(61.46, abs=0.005)
    assert play.body_mass.sum() == pytest.approx(table, abs=1e-9)
    assert training.body_mass.sum() == pytest.approx(table, abs=1e-9)


def test_motors_come_in_the_promised_order(play, training):
    groups = {"legs": 12, "waist": 1, "arms": 14, "hands": 12, "neck": 2}
    assert [j.group for j in H1.motors] == [name for name, count in groups.items() for _ in range(count)]
    assert [play.actuator(i).name for i in range(play.nu)] == list(H1.motor_names)
    assert [training.actuator(i).name for i in range(training.nu)] == list(H1.motor_names[:27])
    assert H1.body_motors == training.nu == 27


def test_training_and_play_share_kinematics_and_inertia_when_hands_and_neck_are_straight(play, training):
    rng = np.random.default_rng(1)
    body = [m.name for m in H1.motors[: H1.body_motors]]
    for _ in range(3):
        angles = {name: angle for name, angle in random_angles(rng).items() if name in body}
        full, welded = posed(play, angles), posed(training, angles)
        for name in [m.body for m in H1.motors[: H1.body_motors]]:
            np.testing.assert_allclose(full.body(name).xpos, welded.body(name).xpos, atol=1e-12)
            np.testing.assert_allclose(full.body(name).xmat, welded.body(name).xmat, atol=1e-12)
        for site in (*H1.wrists, *H1.feet):
            np.testing.assert_allclose(full.site(site).xpos, welded.site(site).xpos, atol=1e-12)
        dofs = [np.r_[0:6, [model.joint(name).dofadr[0] for name in body]] for model in (play, training)]
        np.testing.assert_allclose(
            mass_matrix(play, full)[np.ix_(dofs[0], dofs[0])], mass_matrix(training, welded)[np.ix_(dofs[1], dofs[1])], atol=1e-9
        )


def mass_matrix(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    dense = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, dense)
    return dense


def test_the_mirrored_pose_is_the_mirror_image_of_the_pose(play):
    rng = np.random.default_rng(2)
    permutation, sign = H1.mirror
    for _ in range(5):
        q = np.array([random_angles(rng)[name] for name in H1.motor_names])
        q[H1.group("hands")] = 0
        here = posed(play, dict(zip(H1.motor_names, q, strict=True)))
        there = posed(play, dict(zip(H1.motor_names, sign * q[permutation], strict=True)))
        for body in H1.bodies:
            if body.name.startswith(("L_", "R_")):
                continue  # hand frames are not mirror images
            other = swapped(body.name)
            np.testing.assert_allclose(there.body(other).xpos, MIRROR @ here.body(body.name).xpos, atol=1e-9)
            if other != body.name:  # the trunk's own mass is a little to one side
                np.testing.assert_allclose(there.body(other).xipos, MIRROR @ here.body(body.name).xipos, atol=1e-9)
            turned = MIRROR @ here.body(body.name).xmat.reshape(3, 3) @ MIRROR
            np.testing.assert_allclose(there.body(other).xmat.reshape(3, 3), turned, atol=1e-9)
        for site in (*H1.wrists, *H1.feet):
            np.testing.assert_allclose(there.site(swapped(site)).xpos, MIRROR @ here.site(site).xpos, atol=1e-9)


def test_mirrored_hands_put_their_fingertips_at_mirrored_places(play):
    rng = np.random.default_rng(3)
    for _ in range(3):
        left = {name: angle for name, angle in random_angles(rng).items() if name.startswith("L_")}
        data = posed(play, left | {name.replace("L_", "R_"): angle for name, angle in left.items()})
        for finger in FINGERTIPS:
            tip, other = data.site(f"L_{finger}_tip").xpos, data.site(f"R_{finger}_tip").xpos
            # the source's zero of the thumb's yaw differs by 6.5 degrees between the hands; fingers differ by less than 1 mm
            np.testing.assert_allclose(other, MIRROR @ tip, atol=0.012 if finger == "thumb" else 1e-3)


def swapped(name: str) -> str:
    if "left" in name:
        return name.replace("left", "right")
    return name.replace("right", "left")


def test_closing_fingers_brings_the_tips_to_the_palm(play):
    closed = {j.name: j.upper for j in H1.joints if "thumb" not in j.name and j.group == "hands"}
    opened, shut = posed(play, {}), posed(play, closed)
    for side, wrist in (("L", "left_wrist"), ("R", "right_wrist")):
        for finger in ("index", "middle", "ring", "pinky"):
            reach = [np.linalg.norm(data.site(f"{side}_{finger}_tip").xpos - data.site(wrist).xpos) for data in (opened, shut)]
            assert reach[0] > 0.17
            assert reach[1] < 0.12


def test_wrist_frames_look_along_the_fingers_with_z_up(play):
    data = posed(play, {"left_elbow_pitch_joint": 0.0, "right_elbow_pitch_joint": 0.0})  # upper arms down, forearms level
    for side, wrist in (("L", "left_wrist"), ("R", "right_wrist")):
        np.testing.assert_allclose(data.site(wrist).xmat.reshape(3, 3), np.eye(3), atol=1e-9)
        along = data.site(f"{side}_middle_tip").xpos - data.site(wrist).xpos
        assert along[0] > 0.9 * np.linalg.norm(along)


def test_home_stands_with_every_sole_sphere_on_the_floor_and_the_feet_under_the_mass(play, training):
    for model in (play, training):
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
        mujoco.mj_forward(model, data)
        spheres = [g for g in range(model.ngeom) if "_sole_" in model.geom(g).name]
        assert len(spheres) == 8
        np.testing.assert_allclose(data.geom_xpos[spheres, 2] - model.geom_size[spheres, 0], 0, atol=1e-9)
        assert data.body("pelvis").xpos[2] == pytest.approx(H1.nominal_height, abs=0.02)
        feet, mass = data.geom_xpos[spheres], data.subtree_com[0]
        assert feet[:, 0].min() + 0.03 < mass[0] < feet[:, 0].max() - 0.03
        assert mass[1] == pytest.approx(0, abs=2e-3)
        np.testing.assert_allclose(data.ctrl, H1.home[: model.nu])


def test_mass_centre_and_energy_agree_with_a_computation_from_the_table(play):
    """Own forward kinematics in numpy: pose and velocity of each link, then sums over links."""
    rng = np.random.default_rng(4)
    for _ in range(3):
        angles, data = random_angles(rng), mujoco.MjData(play)
        data.qpos[:3], data.qvel[:] = rng.normal(size=3), rng.normal(size=play.nv)
        data.qpos[3:7] = rng.normal(size=4)
        data.qpos[3:7] /= np.linalg.norm(data.qpos[3:7])
        for name, angle in angles.items():
            data.qpos[play.joint(name).qposadr[0]] = angle
        mujoco.mj_forward(play, data)
        speeds = {j.name: data.qvel[play.joint(j.name).dofadr[0]] for j in H1.joints}
        centre, energy = centre_and_energy(data.qpos[:7], data.qvel[:6], angles, speeds)
        np.testing.assert_allclose(data.subtree_com[0], centre, atol=1e-9)
        assert 0.5 * data.qvel @ mass_matrix(play, data) @ data.qvel == pytest.approx(energy, rel=1e-9)


def centre_and_energy(base: np.ndarray, twist: np.ndarray, angles: dict, speeds: dict) -> tuple[np.ndarray, float]:
    """Centre of mass and kinetic energy of the table's links and rotors."""
    joint_of = {j.body: j for j in H1.joints}
    R0 = rotation(base[3:])
    pose, motion = {None: (base[:3], R0)}, {None: (twist[:3], R0 @ twist[3:])}
    moment, mass, energy = np.zeros(3), 0.0, 0.0
    for link in H1.bodies:
        (p, R), (v, w) = pose[link.parent], motion[link.parent]
        offset = R @ link.pos
        p, v, R = p + offset, v + np.cross(w, offset), R @ rotation(np.array(link.quat))
        if joint := joint_of.get(link.name):
            w = w + R @ joint.axis * speeds[joint.name]
            half = angles[joint.name] / 2
            R = R @ rotation(np.r_[np.cos(half), np.sin(half) * np.array(joint.axis)])
            energy += 0.5 * joint.armature * speeds[joint.name] ** 2
        pose[link.name], motion[link.name] = (p, R), (v, w)
        com = p + R @ link.com
        moment, mass = moment + link.mass * com, mass + link.mass
        xx, yy, zz, xy, xz, yz = link.inertia
        inertia = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T
        energy += 0.5 * link.mass * np.sum((v + np.cross(w, com - p)) ** 2) + 0.5 * w @ inertia @ w
    return moment / mass, energy


def rotation(quaternion: np.ndarray) -> np.ndarray:
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_home_and_limits_are_their_own_mirror_image():
    permutation, sign = H1.mirror
    np.testing.assert_allclose(sign * H1.home[permutation], H1.home)
    mirrored = np.sort([sign * H1.lower[permutation], sign * H1.upper[permutation]], axis=0)
    np.testing.assert_allclose(mirrored, [H1.lower, H1.upper])
    np.testing.assert_array_equal(permutation[permutation], np.arange(len(H1.motors)))
