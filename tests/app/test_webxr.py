"""From a headset's packet to what the robot is asked: frame, clutch, scale, lost tracking, fingers, neck."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.inputs.webxr import ARM, BadPacket, Headset, Headsets
from app.protocol import HEADSET, HEADSET_VERSION, Asks, OperatorMessage, Seen, headset_packet
from policies.command import Command
from robots import catalog

ALL = Asks.LEFT_ARM | Asks.RIGHT_ARM | Asks.NECK | Asks.FINGERS
SEEN = Seen.HEAD | Seen.LEFT_WRIST | Seen.RIGHT_WRIST
EVEN = Rotation.identity()


def row(position: np.ndarray, turn: Rotation) -> np.ndarray:
    return np.array([*position, *turn.as_quat()])


class Operator:
    """A person in a headset, in WebXR's axes (x right, y up, z back), who looks by `yaw` to the left."""

    def __init__(self, headset: Headset, command: list[Command], yaw: float = 0.0) -> None:
        self.headset, self._command = headset, command
        self.yaw, self.arm, self.time, self.origin = yaw, ARM, 5.0, 0
        self.look = Rotation.from_euler("y", yaw)
        self.hands = [self.look.apply([-0.2, 1.1, -0.4]), self.look.apply([0.2, 1.1, -0.4])]
        self.turns = [EVEN, EVEN]
        self.head = self.look

    def send(self, asks: int = ALL, valid: int = SEEN, elapsed: float = 1 / 60, **fields) -> OperatorMessage:
        self.time += elapsed
        packet = np.zeros((), HEADSET)
        packet["version"], packet["asks"], packet["valid"], packet["origin"] = HEADSET_VERSION, asks, valid, self.origin
        packet["time"], packet["arm"] = self.time, self.arm
        packet["head"] = row(np.array([0, 1.6, 0]), self.head)
        packet["wrists"] = [row(hand, turn) for hand, turn in zip(self.hands, self.turns, strict=True)]
        for name, value in fields.items():
            packet[name] = value
        message = self.headset.message(packet.tobytes())
        assert message is not None
        if message.wrists:
            self._obey(message)
        return message

    def move(self, side: int, by: np.ndarray, steps: int = 30, **how) -> OperatorMessage:
        """Move a hand by so many metres to the right, up and back, as the person sees it."""
        for _ in range(steps):
            self.hands[side] = self.hands[side] + self.look.apply(by) / steps
            message = self.send(**how)
        return message

    def _obey(self, message: OperatorMessage) -> None:
        """The robot does as it is told."""
        wrists = self.wrists.copy()
        for side, pose in enumerate((message.wrists.left, message.wrists.right)):
            if pose:
                wrists[side] = [*pose.position, *pose.quaternion]
        self._command[0] = replace(self._command[0], wrists=wrists)

    @property
    def wrists(self) -> np.ndarray:
        return self._command[0].wrists


@pytest.fixture(scope="module")
def headsets() -> Headsets:
    robot = catalog.load("h1")
    return Headsets(robot.spec, robot.model("play"), Command)


@pytest.fixture
def person(headsets: Headsets) -> Operator:
    return someone(headsets)


def someone(headsets: Headsets, yaw: float = 0.0) -> Operator:
    command = [Command()]
    headset = headsets.join()
    headset._applied = lambda: command[0]
    return Operator(headset, command, yaw)


def test_the_wrist_goes_where_the_hand_goes_however_the_person_stands(headsets):
    home = Command().wrists
    for yaw in (0.0, 1.2, -2.5):
        person = someone(headsets, yaw)
        person.arm = person.headset._reach  # as long an arm as the robot's
        person.send()
        np.testing.assert_allclose(person.wrists, home, atol=1e-3)
        person.move(0, np.array([0.1, 0.2, -0.3]))
        np.testing.assert_allclose(person.wrists[0, :3] - home[0, :3], [0.3, -0.1, 0.2], atol=1e-5)
        np.testing.assert_allclose(person.wrists[1], home[1], atol=1e-3)


def test_the_wrist_turns_as_the_hand_turns(person):
    person.send()
    before = Rotation.from_quat(person.wrists[1, 3:], scalar_first=True)
    for step in range(31):
        person.turns[1] = Rotation.from_euler("y", step / 30 * 0.6)  # to the left, about the vertical
        person.send()
    after = Rotation.from_quat(person.wrists[1, 3:], scalar_first=True)
    np.testing.assert_allclose((after * before.inv()).as_rotvec(), [0, 0, 0.6], atol=1e-6)


def test_a_long_arm_moves_the_robots_shorter_one_less(person):
    person.arm = 0.8
    person.send()
    before = person.wrists[0, 0]
    person.move(0, np.array([0, 0, -0.2]))
    assert person.wrists[0, 0] - before == pytest.approx(0.2 * person.headset._reach / 0.8, abs=1e-6)


def test_clutch_out_holds_and_clutch_in_goes_on_without_a_jump(person):
    person.send()
    person.move(0, np.array([0, 0.2, 0]))
    before = person.wrists.copy()
    for message in (person.move(0, np.array([0.1, -0.3, 0.1]), asks=ALL & ~Asks.LEFT_ARM) for _ in range(2)):
        assert message.wrists.left is None
    person.send()
    np.testing.assert_allclose(person.wrists, before, atol=1e-6)
    person.move(0, np.array([0, 0, -0.05]))
    assert person.wrists[0, 0] > before[0, 0] + 0.04


@pytest.mark.parametrize("seconds", [0.05, 2.0])
def test_a_hand_that_is_not_seen_holds_the_arm_and_comes_back_without_a_jump(person, seconds):
    person.send()
    person.move(0, np.array([0, 0.1, 0]))
    before = person.wrists.copy()
    for _ in range(round(seconds * 60)):
        message = person.send(valid=SEEN & ~Seen.LEFT_WRIST)
        assert message.wrists.left is None
        assert message.wrists.right is not None
    person.hands[0] = person.hands[0] + np.array([0.3, 0.2, 0.1])
    person.send()
    np.testing.assert_allclose(person.wrists, before, atol=1e-6)


def test_a_jump_of_the_tracking_does_not_move_the_arm(person):
    person.send()
    before = person.wrists.copy()
    person.hands[1] = person.hands[1] + np.array([0.07, 0, 0])
    person.turns[0] = Rotation.from_euler("x", 0.5)
    person.send()
    np.testing.assert_allclose(person.wrists, before, atol=1e-6)
    person.move(1, np.array([0, 0.05, 0]))
    assert person.wrists[1, 2] > before[1, 2] + 0.04


def test_after_a_silence_hands_are_coupled_anew(person):
    person.send()
    before = person.wrists.copy()
    person.hands[0] = person.hands[0] + np.array([0.0, 0.05, 0])
    person.send(elapsed=1.0)
    np.testing.assert_allclose(person.wrists, before, atol=1e-6)


def test_a_recentre_takes_the_frame_anew_and_moves_nothing(person):
    person.send()
    before = person.wrists.copy()
    person.origin, person.look = 1, Rotation.from_euler("y", np.pi / 2)
    person.head = person.look
    person.hands = [person.look.apply(hand) for hand in person.hands]  # the person turned to the left
    assert person.send().neck.yaw == pytest.approx(0, abs=1e-6)
    np.testing.assert_allclose(person.wrists, before, atol=1e-6)
    person.move(0, np.array([0, 0, -0.1]))
    assert person.wrists[0, 0] > before[0, 0] + 0.09


def test_without_a_head_there_is_no_frame_and_nothing_moves(headsets):
    person = someone(headsets)
    message = person.send(valid=SEEN & ~Seen.HEAD)
    assert message.wrists is None
    assert message.neck is None
    assert person.send().wrists is not None
    assert person.send(valid=SEEN & ~Seen.HEAD).wrists is not None, "once there is one, the head may be lost for a while"


def test_the_neck_follows_the_head(person):
    person.send()
    person.head = Rotation.from_euler("YX", [0.4, -0.3])  # to the left, then down
    neck = person.send().neck
    assert (neck.yaw, neck.pitch) == (pytest.approx(0.4), pytest.approx(0.3))
    assert person.send(asks=ALL & ~Asks.NECK).neck is None


@pytest.mark.parametrize(
    "broken", [np.full(7, np.nan), np.zeros(7), np.array([0, 0, 0, 0.3, 0, 0, 0.3]), np.array([1e9, 0, 0, 0, 0, 0, 1])]
)
def test_what_is_no_pose_counts_as_not_seen(person, broken):
    person.send()
    before = person.wrists.copy()
    good = row(person.hands[1], EVEN)
    message = person.send(wrists=np.stack([broken, good]))
    assert message.wrists.left is None
    np.testing.assert_allclose(person.wrists, before, atol=1e-6)
    assert person.send(head=broken).neck is None


def test_fingers_bend_and_controllers_grip(person):
    joints = np.zeros((2, 25, 3))
    for finger, across in enumerate((0.04, 0.03, 0.01, -0.01, -0.03)):
        for joint in range(4 if finger == 0 else 5):
            joints[:, 5 * finger - (finger > 0) + 1 + joint] = [across, -0.004 * joint**2, -0.02 - 0.03 * joint]
    opened = person.send(valid=SEEN | Seen.LEFT_FINGERS, joints=joints).hands
    assert opened.right is None
    assert max(opened.left[2:]) < 0.3
    hands = person.send(valid=SEEN | Seen.RIGHT_GRIP, grips=[0.0, 0.7]).hands
    assert hands.left is None
    np.testing.assert_allclose(hands.right, 0.7, atol=1e-6)
    assert person.send(asks=ALL & ~Asks.FINGERS, valid=SEEN | Seen.LEFT_FINGERS, joints=joints).hands is None
    lost = person.send(valid=SEEN | Seen.LEFT_FINGERS, joints=joints * np.nan).hands
    np.testing.assert_allclose(lost.left, opened.left, atol=0.05)


def test_an_older_packet_says_nothing_and_a_strange_one_is_refused(person):
    person.send()
    packet = np.zeros((), HEADSET)
    packet["version"], packet["time"] = HEADSET_VERSION, person.time
    assert person.headset.message(packet.tobytes()) is None
    with pytest.raises(BadPacket, match="bytes"):
        person.headset.message(b"123")
    packet["version"] = HEADSET_VERSION + 1
    with pytest.raises(BadPacket, match="reload"):
        person.headset.message(packet.tobytes())


def test_random_packets_never_raise_and_never_ask_for_what_is_no_pose(headsets):
    person, rng = someone(headsets), np.random.default_rng(3)
    for _ in range(2000):
        packet = np.frombuffer(rng.bytes(HEADSET.itemsize), HEADSET)[0].copy()
        packet["version"], packet["time"] = HEADSET_VERSION, rng.choice([np.nan, rng.uniform(0, 1e3)])
        message = person.headset.message(packet.tobytes())
        if message and message.wrists:
            for pose in (message.wrists.left, message.wrists.right):
                assert pose is None or np.isfinite([*pose.position, *pose.quaternion]).all()


def test_the_layout_told_to_pages_is_the_one_that_is_read():
    layout = headset_packet()
    assert layout.size == HEADSET.itemsize
    assert {field.name for field in layout.fields} == set(HEADSET.names)
    widths = {"u1": 1, "u4": 4, "f4": 4, "f8": 8}
    ends = [field.offset + widths[field.type] * field.count for field in layout.fields]
    assert [field.offset for field in layout.fields] + [layout.size] == [0, *ends]


def test_webxr_axes_are_turned_as_openxr_says():
    from app.inputs.webxr import AXES

    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, AXES)
    np.testing.assert_allclose(turn.reshape(3, 3), [[0, 0, -1], [-1, 0, 0], [0, 1, 0]], atol=1e-12)
