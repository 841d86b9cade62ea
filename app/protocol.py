"""The wire, declared once: what a page or a script sends and what it gets back. Served as schemas at /docs.

Not a number, infinities, non-unit quaternions and unknown fields never pass.
"""

from __future__ import annotations

import math
from enum import IntFlag
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, FiniteFloat

from app.arbiter import Role

VERSION = 1
"""Of this wire; a page that meets another number reloads itself."""

State = Literal["STOPPED", "HOLD", "ENGAGED", "FAULT"]
Vector3 = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
Fraction = Annotated[FiniteFloat, Field(ge=0, le=1)]


def _unit(q: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    if abs(math.sqrt(sum(x * x for x in q)) - 1) > 0.01:
        raise ValueError("a quaternion (w, x, y, z) has length 1")
    return q


Quaternion = Annotated[tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat], AfterValidator(_unit)]


class Wire(BaseModel):
    """Everything on the wire: no unknown fields."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Pose(Wire):
    """Of a wrist, in the pelvis frame: x forward, y left, z up."""

    position: Vector3
    """m"""
    quaternion: Quaternion
    """w, x, y, z"""


class Twist(Wire):
    """Velocity in the heading frame."""

    vx: FiniteFloat = 0.0
    """Forward [m/s]."""
    vy: FiniteFloat = 0.0
    """To the left [m/s]."""
    yaw_rate: FiniteFloat = 0.0
    """Counter-clockwise [rad/s]."""


class Wrists(Wire):
    """Targets; a wrist that is left out keeps its newest one."""

    left: Pose | None = None
    right: Pose | None = None


class Hands(Wire):
    """Thumb yaw, thumb pitch, index, middle, ring, pinky; 0 open, 1 closed."""

    left: Annotated[tuple[Fraction, ...], Field(min_length=6, max_length=6)] | None = None
    right: Annotated[tuple[Fraction, ...], Field(min_length=6, max_length=6)] | None = None


class Neck(Wire):
    """Where the head looks."""

    yaw: FiniteFloat = 0.0
    """rad, to the left"""
    pitch: FiniteFloat = 0.0
    """rad, down"""


Milliseconds = Annotated[FiniteFloat, Field(ge=0, le=60_000)]


class PageTiming(Wire):
    """What only a page can time, smoothed [ms]."""

    device: Milliseconds | None = None
    """From the event of the mouse, key or pad to the message that tells it."""
    network: Milliseconds | None = None
    """Of a message, one way: half of the way there and back, without the server's wait in between."""
    stream: Milliseconds | None = None
    """From the end of a tick to the page that has its frame."""
    picture: Milliseconds | None = None
    """From there until it is handed to the drawing."""


class OperatorMessage(Wire):
    """What a client of WS /api/operator sends, at 20 Hz or faster: the message is the heartbeat.

    A field that is left out keeps its newest value. Who sends neither `engage` nor a drive field only watches.
    """

    seq: Annotated[int, Field(ge=0, lt=2**53)]
    """Any growing number; the answer repeats the newest one."""
    engage: bool | None = None
    """Whether the enable is held. Only a fresh press (false, then true) engages."""
    twist: Twist | None = None
    height: FiniteFloat | None = None
    """Pelvis above the floor [m]."""
    roll: FiniteFloat | None = None
    """Lean to the right [rad]."""
    pitch: FiniteFloat | None = None
    """Lean forward [rad]."""
    wrists: Wrists | None = None
    smooth: bool | None = None
    """Filter `wrists` (1€ filter, app.one_euro): for hands that are tracked; a mouse needs none."""
    hands: Hands | None = None
    neck: Neck | None = None
    waist: FiniteFloat | None = None
    """Waist yaw [rad]."""
    roles: Annotated[list[Role], Field(max_length=2)] | None = None
    """What this client drives, or would: arms and legs, unless it says otherwise. A role that is not listed any more is free."""
    take: bool = False
    """Take `roles` from whoever drives them; what was taken holds until the next fresh press."""
    ask: bool = False
    """Ask whoever drives them for `roles`, for as long as messages say so."""
    give: Annotated[str, Field(max_length=20)] | None = None
    """Hand what this client drives to the client with this id, as far as that one wants it (its `roles`); it holds in between."""
    timing: PageTiming | None = None
    """How long things take on the client's side."""
    name: Annotated[str, Field(min_length=1, max_length=40)] | None = None
    """How others see this client; otherwise it is numbered."""

    @property
    def drives(self) -> bool:
        """Whether this message takes its client's roles where they are free."""
        fields = (self.twist, self.height, self.roll, self.pitch, self.wrists, self.hands, self.neck, self.waist)
        return bool(self.engage) or any(field is not None for field in fields)


class Percentiles(Wire):
    """Over the last 10 s [ms]."""

    p50: float
    p99: float


class Base(Wire):
    """The pelvis in the world; velocities in the heading frame."""

    x: float
    y: float
    z: float
    yaw: float
    roll: float
    pitch: float
    vx: float
    vy: float
    yaw_rate: float


class Applied(Wire):
    """The command after the guard; its wrists are in BothWrists."""

    vx: float
    vy: float
    yaw_rate: float
    height: float
    roll: float
    pitch: float
    hands: Hands
    neck: Neck
    waist: float
    """rad"""


class Wrist(Wire):
    """One wrist, in the pelvis frame."""

    target: Pose
    """What is asked."""
    reachable: Pose
    """The nearest pose the arm can take."""
    actual: Pose
    """Where it is."""
    limited_by: str
    """Why reachable is not target: limit, collision, reach, speed, solver or invalid; empty when it is, or is on its way."""
    let_go: bool
    """The target jumped: the arm holds until the target comes back or Engage is pressed again."""


class BothWrists(Wire):
    left: Wrist
    right: Wrist


class Latency(Wire):
    """Medians over the last 10 s, a stage each [ms]; what a page timed is the newest word of a driver's page, or of nobody's."""

    device: float | None
    network: float | None
    queue: float
    """From the arrival of the operator's message to the tick that read it."""
    ik: float
    policy: float
    physics: float
    publish: float
    stream: float | None
    picture: float | None
    lateness: float
    """How late the ticks began."""


class Part(Wire):
    """One role of the robot."""

    driver: str | None
    """Who drives it."""
    state: State
    reason: str
    """Why the state is what it is, as a sentence."""


class Parts(Wire):
    arms: Part
    """Wrists, hands, neck and waist."""
    legs: Part
    """Velocity, height and lean."""


class Member(Wire):
    """A client who is connected."""

    id: str
    name: str
    drives: list[Role]
    asks: list[Role]
    """What it would like to drive and another one does."""


class Health(Wire):
    """GET /api/health."""

    version: int = VERSION
    state: State
    """The most severe of what is driven."""
    reason: str
    """Why the state is what it is, as a sentence."""
    roles: Parts
    robot: str
    policy: str
    """Name of the leg weights that walk."""
    policies: list[str]
    """Names of those that can; POST /api/policy changes to another."""
    time: float
    """Simulated seconds."""
    real_time_factor: float
    """Simulated seconds a second, over the last 10 s."""
    ticks: int
    missed: int
    """Ticks that were skipped because the simulation was late."""
    lateness_ms: Percentiles
    ik_ms: Percentiles
    latency_ms: Latency
    filter_ms: float
    """What the filter of the wrists delays them by at their speed now; 0: it is off."""
    scheduler: str
    """What the simulation process runs under: fifo, nice or normal."""
    upright: bool
    base: Base
    command: Applied
    wrists: BothWrists
    driver: str | None
    """Who drives; two names where two share the robot."""
    clients: int
    """Open operator sockets."""
    rejected: int
    """Messages and commands that were refused."""
    recording: str | None = None
    """The episode being recorded."""
    recording_alarm: str | None = None
    """Why the last recording was cut off, or that the disk is slow, as a sentence."""


class Answer(Health):
    """What WS /api/operator sends, at 20 Hz: the health record and this client's own part."""

    seq: int
    """Of the newest message read from this client; -1 before the first."""
    waited: float
    """How long ago that one came [ms]."""
    id: str
    """This client's, for `give` and for POST /api/reset."""
    you: str
    """This client's name."""
    driving: bool
    """Whether this client drives anything."""
    drives: list[Role]
    """What it drives."""
    crew: list[Member]
    """Everybody who is connected, this client too."""
    error: str | None = None
    """Why a message of this client was refused since the last answer."""


HEADSET_VERSION = 1
HEADSET = np.dtype(
    [
        ("version", "u1"),  # HEADSET_VERSION
        ("valid", "u1"),  # Seen: what of the following was tracked in this frame
        ("asks", "u1"),  # Asks: what of it the robot shall follow
        ("origin", "u1"),  # counts recentres: a new number takes the frame anew, by the way that the head looks
        ("seq", "<u4"),  # as OperatorMessage.seq
        ("time", "<f8"),  # of the frame, on the headset's clock [s]
        ("arm", "<f4"),  # the operator's arm from shoulder to wrist [m]; 0: not known
        ("grips", "<f4", (2,)),  # how far the triggers of controllers are pressed, 0 to 1 (left, right)
        ("head", "<f4", (7,)),  # poses: position [m] and quaternion xyzw in WebXR's axes, in a space whose floor is level
        ("wrists", "<f4", (2, 7)),  # a hand's wrist joint, or a controller's grip (left, right)
        ("joints", "<f4", (2, 25, 3)),  # positions of a hand's joints in WebXR's order (left, right)
    ]
)
"""A headset's packet: the binary message of WS /api/operator, at 60 Hz. Everything in it is of this frame, or not valid."""


class Seen(IntFlag):
    """Bits of `valid`: head, wrists, fingers (of hands) and grips (of controllers), left and right."""

    HEAD = 1
    LEFT_WRIST = 2
    RIGHT_WRIST = 4
    LEFT_FINGERS = 8
    RIGHT_FINGERS = 16
    LEFT_GRIP = 32
    RIGHT_GRIP = 64


class Asks(IntFlag):
    """Bits of `asks`. While an arm's bit is set, the wrist goes along with the hand, from wherever both are."""

    LEFT_ARM = 1
    RIGHT_ARM = 2
    NECK = 4
    FINGERS = 8


class PacketField(Wire):
    """One field of a headset's packet."""

    name: str
    type: str
    """u1: byte, u4: 32-bit integer, f4 and f8: floating point, little-endian."""
    offset: int
    """Bytes."""
    count: int
    """Numbers."""


class HeadsetPacket(Wire):
    """GET /api/headset: how a page lays out what it tells of a headset."""

    version: int = HEADSET_VERSION
    size: int = HEADSET.itemsize
    """Bytes."""
    fields: tuple[PacketField, ...]
    valid: dict[str, int] = {bit.name or "": bit.value for bit in Seen}
    asks: dict[str, int] = {bit.name or "": bit.value for bit in Asks}


def headset_packet() -> HeadsetPacket:
    """The layout of HEADSET."""
    fields = []
    for name, (kind, offset, *_) in (HEADSET.fields or {}).items():
        fields.append(PacketField(name=name, type=kind.base.str[1:], offset=offset, count=int(np.prod(kind.shape, dtype=int))))
    return HeadsetPacket(fields=tuple(fields))
