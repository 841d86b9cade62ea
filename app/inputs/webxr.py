"""A headset as a source of commands: wrists, fingers and neck from a packet of app.protocol.HEADSET.

It says what a page says, in the same words (OperatorMessage), through the same lease and guard. Engage, Stop and the velocity
come from the page in which the headset's session runs.
"""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from app.inputs.clutch import STALE, Clutch
from app.protocol import HEADSET, HEADSET_VERSION, Asks, Hands, Neck, OperatorMessage, Pose, Seen, Wrists
from policies.command import Command
from policies.hands import OF_WEBXR, HandRetargeter
from robots.spec import RobotSpec

SIDES = ("left", "right")
ARM = 0.56
"""Shoulder to wrist of an operator who did not say [m]."""
BELIEVED = (0.3, 0.9)
"""Shortest and longest arm that is believed [m]."""
WRIST, FINGERS, GRIP = (
    (Seen.LEFT_WRIST, Seen.RIGHT_WRIST),
    (Seen.LEFT_FINGERS, Seen.RIGHT_FINGERS),
    (Seen.LEFT_GRIP, Seen.RIGHT_GRIP),
)
ARMS = (Asks.LEFT_ARM, Asks.RIGHT_ARM)
AXES = np.array([0.5, 0.5, -0.5, -0.5])
"""Turns WebXR's axes (x right, y up, z back) into the robot's (x forward, y left, z up), wxyz."""
AHEAD = np.array([1.0, 0.0, 0.0])
FARTHEST = 20.0
"""A pose farther than this from the origin was not seen [m]."""


class BadPacket(ValueError):
    """Bytes that are no packet of this version."""


class Headset:
    """What one headset's packets ask for, packet by packet."""

    def __init__(self, retargeters: tuple[HandRetargeter, ...], reach: float, applied: Callable[[], Command]) -> None:
        """
        Args:
            retargeters: of the left and the right hand, this headset's own; none for a robot without hands.
            reach: from the robot's shoulder to its wrist, the arm stretched [m].
            applied: what the robot does now.
        """
        self._retargeters, self._reach, self._applied = retargeters, reach, applied
        self._clutches = (Clutch(), Clutch())
        self._origin: int | None = None
        self._turn = np.empty(4)
        """From WebXR's axes to the pelvis frame's, by the way that the head looked when the frame was taken."""
        self._time = -np.inf
        self._fingers: list[np.ndarray | None] = [None, None]

    def message(self, data: bytes) -> OperatorMessage | None:
        """What a packet says; None if it is older than the one before.

        Raises:
            BadPacket: it has another size or version.
        """
        if len(data) != HEADSET.itemsize:
            raise BadPacket(f"a headset's packet has {HEADSET.itemsize} bytes, not {len(data)}")
        packet = np.frombuffer(data, HEADSET)[0]
        if packet["version"] != HEADSET_VERSION:
            raise BadPacket(f"a headset's packet has version {HEADSET_VERSION}, not {packet['version']}; reload the page")
        with np.errstate(invalid="ignore"):  # what is not a number is not seen
            return self._said(packet)

    def _said(self, packet: np.void) -> OperatorMessage | None:
        time = float(packet["time"])
        if not time > self._time:  # true for a NaN, too
            return None
        elapsed, self._time = time - self._time, time
        head = _pose(packet["head"], packet["valid"] & Seen.HEAD)
        if head is not None and (self._origin != packet["origin"] or self._origin is None):
            self._face(head, int(packet["origin"]))
        fields: dict = {}
        if self._origin == packet["origin"]:
            fields = self._wrists(packet, time) | self._neck(head, packet)
        return OperatorMessage(seq=int(packet["seq"]), **fields, **self._hands(packet, min(elapsed, STALE)))

    def _face(self, head: np.ndarray, origin: int) -> None:
        """Take the frame anew: forward is where the head looks. Hands are coupled anew, where they are."""
        ahead, turn = np.empty(3), np.empty(4)
        mujoco.mju_rotVecQuat(ahead, AHEAD, _turned(AXES, head)[3:])
        mujoco.mju_axisAngle2Quat(turn, np.array([0.0, 0.0, 1.0]), -np.arctan2(ahead[1], ahead[0]))
        mujoco.mju_mulQuat(self._turn, turn, AXES)
        self._origin = origin
        for clutch in self._clutches:
            clutch.release()

    def _wrists(self, packet: np.void, time: float) -> dict:
        applied, poses = self._applied().wrists, {}
        arm = float(packet["arm"])
        scale = self._reach / (arm if BELIEVED[0] <= arm <= BELIEVED[1] else ARM)
        for side, (name, clutch) in enumerate(zip(SIDES, self._clutches, strict=True)):
            if not packet["asks"] & ARMS[side]:
                clutch.release()
                continue
            hand = _pose(packet["wrists"][side], packet["valid"] & WRIST[side])
            target = clutch.step(None if hand is None else _turned(self._turn, hand), time, scale, applied[side])
            if target is not None:
                poses[name] = Pose(position=tuple(target[:3].tolist()), quaternion=tuple(target[3:].tolist()))
        return {"wrists": Wrists(**poses)} if poses else {}

    def _neck(self, head: np.ndarray | None, packet: np.void) -> dict:
        if head is None or not packet["asks"] & Asks.NECK:
            return {}
        ahead = np.empty(3)
        mujoco.mju_rotVecQuat(ahead, AHEAD, _turned(self._turn, head)[3:])
        x, y, z = ahead.tolist()
        return {"neck": Neck(yaw=float(np.arctan2(y, x)), pitch=float(np.arctan2(-z, np.hypot(x, y))))}

    def _hands(self, packet: np.void, elapsed: float) -> dict:
        if not (self._retargeters and packet["asks"] & Asks.FINGERS):
            return {}
        drives = {}
        for side, (name, retargeter) in enumerate(zip(SIDES, self._retargeters, strict=True)):
            if packet["valid"] & FINGERS[side]:
                drives[name] = tuple(np.clip(retargeter.solve(packet["joints"][side][OF_WEBXR], elapsed), 0, 1).tolist())
            elif packet["valid"] & GRIP[side] and np.isfinite(packet["grips"][side]):
                drives[name] = (float(np.clip(packet["grips"][side], 0, 1)),) * 6
        return {"hands": Hands(**drives)} if drives else {}


class Headsets:
    """Makes the conversion of each headset that connects."""

    def __init__(self, spec: RobotSpec, model: mujoco.MjModel, applied: Callable[[], Command]) -> None:
        """model: the robot's play model, only read. applied: what the robot does now."""
        self._retargeters = tuple(HandRetargeter(spec, model, side) for side in (0, 1)) if spec.hands else ()
        self._reach, self._applied = arm_reach(spec, model), applied

    def join(self) -> Headset:
        """One more headset. Its calls and the other ones' come from one thread."""
        return Headset(tuple(retargeter.twin() for retargeter in self._retargeters), self._reach, self._applied)


def arm_reach(spec: RobotSpec, model: mujoco.MjModel) -> float:
    """From the first joint of the left arm to its wrist when the arm is stretched [m]: the farthest of many postures."""
    joints = [model.joint(joint.name) for joint in spec.motors[spec.group("arms")] if _moves(model, joint.name, spec.wrists[0])]
    data, farthest, rng = mujoco.MjData(model), 0.0, np.random.default_rng(0)
    for _ in range(400):
        for joint in joints:
            data.qpos[joint.qposadr[0]] = rng.uniform(*joint.range)
        mujoco.mj_kinematics(model, data)
        farthest = max(farthest, float(np.linalg.norm(data.site(spec.wrists[0]).xpos - data.xanchor[joints[0].id])))
    return farthest


def _moves(model: mujoco.MjModel, joint: str, site: str) -> bool:
    body, moved = int(model.site(site).bodyid[0]), int(model.joint(joint).bodyid[0])
    while body not in (0, moved):
        body = int(model.body_parentid[body])
    return body == moved


def _pose(row: np.ndarray, valid: int) -> np.ndarray | None:
    """Position and unit quaternion wxyz [7] of a row with xyzw, as WebXR has it; None if it was not seen or is no pose."""
    if not valid:
        return None
    x, y, z, qx, qy, qz, qw = row.astype(float).tolist()
    pose = np.array([x, y, z, qw, qx, qy, qz])
    length = float(np.linalg.norm(pose[3:]))
    if not (np.abs(pose[:3]).max() < FARTHEST and abs(length - 1) < 0.05):  # true for a NaN, too
        return None
    pose[3:] /= length
    return pose


def _turned(turn: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """A pose [7] of something whose own axes are WebXR's, in other axes and with other axes of its own: x forward, z up."""
    turned, back = np.empty(7), np.empty(4)
    mujoco.mju_rotVecQuat(turned[:3], pose[:3], turn)
    mujoco.mju_negQuat(back, AXES)
    mujoco.mju_mulQuat(turned[3:], turn, pose[3:])
    mujoco.mju_mulQuat(turned[3:], turned[3:].copy(), back)
    return turned
