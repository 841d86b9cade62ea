"""A hand-made skeleton whose poses have known angles, read and seen as a person."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from policies.motion import bvh
from policies.motion.errors import UnreadableMotion
from policies.motion.human import elbow_side, observe
from policies.motion.skeleton import MissingJoints, find


def test_a_t_pose_is_read_with_its_axes_turned_up(tmp_path: Path, write: Callable[..., Path]) -> None:
    motion = bvh.read(write(tmp_path / "t.bvh", {}))
    hand = motion.positions[0, motion.names.index("LeftHand")]
    assert hand == pytest.approx([0, 7, 5])  # x forward, y left, z up
    assert motion.rate == pytest.approx(60, rel=1e-4)


def test_gzip_reads_the_same(tmp_path: Path, hanging: Callable[..., Path]) -> None:
    bend = np.linspace(0, 90, 60)
    plain = bvh.read(hanging(tmp_path / "a.bvh", bend))
    packed = bvh.read(hanging(tmp_path / "a.bvh.gz", bend))
    np.testing.assert_array_equal(plain.positions, packed.positions)


def test_hanging_arms_with_bent_elbows_are_the_frames_own_zero(tmp_path: Path, hanging: Callable[..., Path]) -> None:
    bend = np.linspace(20, 120, 60)
    motion = bvh.read(hanging(tmp_path / "a.bvh", bend))
    person = observe(motion, elbow_side(motion))
    np.testing.assert_allclose(person.upper_arm, np.broadcast_to(np.eye(3), (60, 2, 3, 3)), atol=1e-5)
    np.testing.assert_allclose(np.degrees(person.flexion), np.stack([bend, bend], 1), atol=1e-3)
    np.testing.assert_allclose(person.hand, np.broadcast_to(np.eye(3), (60, 2, 3, 3)), atol=1e-5)
    np.testing.assert_allclose(person.wrist[0, 0], [0.4 * np.sin(np.radians(20)), 0, -0.6 - 0.4 * np.cos(np.radians(20))], atol=1e-5)


def test_a_straight_arm_keeps_the_twist_its_bone_carries(tmp_path: Path, hanging: Callable[..., Path]) -> None:
    bend = np.concatenate([np.full(60, 90.0), np.zeros(60)])
    motion = bvh.read(hanging(tmp_path / "a.bvh", bend))
    person = observe(motion, elbow_side(motion))
    np.testing.assert_allclose(person.upper_arm[-1], np.broadcast_to(np.eye(3), (2, 3, 3)), atol=1e-5)


def test_turning_the_chest_left_is_positive_waist(tmp_path: Path, write: Callable[..., Path]) -> None:
    turn = np.linspace(0, 40, 60)
    motion = bvh.read(write(tmp_path / "a.bvh", {"Spine": (turn, 1)}))
    person = observe(motion, elbow_side(motion) + np.array([[0, 0, 1.0], [0, 0, 1.0]]))
    np.testing.assert_allclose(np.degrees(person.waist), turn, atol=1e-3)
    np.testing.assert_allclose(person.heading, 0, atol=1e-6)


def test_size_is_counted_in_legs(tmp_path: Path, write: Callable[..., Path]) -> None:
    way = np.stack([np.zeros(60), np.full(60, 12.0), np.linspace(0, 10, 60)], 1)
    motion = bvh.read(write(tmp_path / "a.bvh", {}, root=way))
    person = observe(motion, np.array([[0, 0, 1.0], [0, 0, 1.0]]))
    np.testing.assert_allclose(person.pelvis[-1] - person.pelvis[0], [1, 0, 0], atol=1e-6)
    assert person.standing == pytest.approx(1.0)


@pytest.mark.parametrize("prefix", ["", "mixamorig:"])
def test_joints_are_found_by_name(tmp_path: Path, prefix: str, write: Callable[..., Path]) -> None:
    motion = bvh.read(write(tmp_path / "a.bvh", {}, rename=prefix))
    parts = find(motion)
    assert motion.names[parts.forearm[1]] == f"{prefix}RightForeArm"
    assert motion.names[parts.chest] == f"{prefix}Spine"
    assert motion.names[parts.pelvis] == f"{prefix}Hips"


def test_a_missing_joint_is_named(tmp_path: Path, write: Callable[..., Path]) -> None:
    path = write(tmp_path / "a.bvh", {})
    path.write_text(path.read_text().replace("LeftForeArm", "Tentacle"))
    with pytest.raises(MissingJoints, match=r"left forearm.*Tentacle"):
        find(bvh.read(path))


@pytest.mark.parametrize(
    "damage", [lambda raw: raw[: len(raw) // 2], lambda raw: raw.replace(b"0.000000", b"nan", 1), lambda _: b"", lambda _: b"\xff\xfe"]
)
def test_a_damaged_file_is_refused_by_name(tmp_path: Path, damage, write: Callable[..., Path]) -> None:
    path = write(tmp_path / "broken.bvh", {})
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(UnreadableMotion, match=r"broken\.bvh"):
        bvh.read(path)
