"""What a robot is: bodies, joints, motors and how they mirror. Pure numbers, no simulation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

Vec = tuple[float, ...]
Group = Literal["legs", "waist", "arms", "hands", "neck"]


@dataclass(frozen=True)
class Body:
    """A rigid link. Position [m] and quaternion (wxyz) are in the parent's frame."""

    name: str
    parent: str | None
    pos: Vec
    quat: Vec
    mass: float
    """kg"""
    com: Vec
    """Centre of mass in the body frame [m]."""
    inertia: Vec
    """xx yy zz xy xz yz about the centre of mass, body axes [kg m^2]."""


@dataclass(frozen=True)
class Joint:
    """A hinge at its body's origin, driven by a position motor unless `mimic` is set."""

    name: str
    body: str
    axis: Vec
    lower: float
    """rad"""
    upper: float
    """rad"""
    effort: float
    """Largest torque [N m]."""
    velocity: float
    """Largest speed [rad/s]."""
    group: Group
    kp: float = 0.0
    """Stiffness of the position motor [N m/rad]."""
    kd: float = 0.0
    """Damping of the position motor [N m s/rad]."""
    home: float = 0.0
    """Default angle [rad]."""
    armature: float = 0.01
    """Reflected rotor inertia [kg m^2]."""
    damping: float = 0.0
    """Passive damping [N m s/rad]."""
    mimic: tuple[str, float] | None = None
    """(leading joint, ratio): this joint has no motor and follows the leader."""


@dataclass(frozen=True)
class Hand:
    """One hand: five fingers in the order thumb, index, middle, ring, pinky."""

    palm: str
    """Body that carries the fingers; its origin is the wrist."""
    knuckles: tuple[str, ...]
    """Bodies at whose origins the fingers begin."""
    tips: tuple[str, ...]
    """Sites of the play model at the fingers' ends."""
    pinch: Vec
    """Where thumb and index fingertip touch: of every drive's way, 0 open, 1 closed."""


@dataclass(frozen=True)
class RobotSpec:
    """One robot as data. Motor order is the order of every `q`, `Target.q` and `ctrl` in this project:
    legs (left, right), waist, arms (left, right), hands (left, right), neck."""

    name: str
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    """Motors first, in motor order; then the joints that mimic one."""
    nominal_height: float
    """Pelvis height the legs hold when asked for nothing else [m]."""
    policy_rate: float
    """Ticks a second [Hz]."""
    wrists: tuple[str, str]
    """Names of the left and right wrist sites: the frames that an operator drives."""
    feet: tuple[str, str]
    """Names of the left and right sole sites."""
    hands: tuple[Hand, Hand] | None = None
    """Left and right; the motors of group "hands" are the left one's, then the right one's."""

    @cached_property
    def motors(self) -> tuple[Joint, ...]:
        return tuple(j for j in self.joints if j.mimic is None)

    @cached_property
    def motor_names(self) -> tuple[str, ...]:
        return tuple(j.name for j in self.motors)

    def group(self, *names: Group) -> slice:
        """Slice of the motor order that holds the named groups (they must be neighbours)."""
        at = [i for i, j in enumerate(self.motors) if j.group in names]
        if not at or at != list(range(at[0], at[-1] + 1)):
            raise ValueError(f"groups {names} are not one run of {self.name}'s motors")
        return slice(at[0], at[-1] + 1)

    @cached_property
    def body_motors(self) -> int:
        """Motors of legs, waist and arms: those of the training model, always the first ones."""
        return self.group("legs", "waist", "arms").stop

    def _column(self, field: str) -> np.ndarray:
        return np.array([getattr(j, field) for j in self.motors])

    @cached_property
    def home(self) -> np.ndarray:
        """Default motor angles [nu], rad."""
        return self._column("home")

    @cached_property
    def lower(self) -> np.ndarray:
        """Lower joint limits [nu], rad."""
        return self._column("lower")

    @cached_property
    def upper(self) -> np.ndarray:
        """Upper joint limits [nu], rad."""
        return self._column("upper")

    @cached_property
    def velocity(self) -> np.ndarray:
        """Joint speed limits [nu], rad/s."""
        return self._column("velocity")

    @cached_property
    def mirror(self) -> tuple[np.ndarray, np.ndarray]:
        """(permutation, sign), each [nu]: `sign * q[permutation]` is q seen in the sagittal mirror.

        A roll or yaw of the body changes sign, a pitch does not; hand drives close on both sides alike.
        """
        at = {name: i for i, name in enumerate(self.motor_names)}
        permutation = np.array([at[_other_side(name)] for name in self.motor_names])
        flips = [j.group != "hands" and abs(j.axis[1]) < 0.5 for j in self.motors]
        return permutation, np.where(flips, -1.0, 1.0)


def _other_side(name: str) -> str:
    for left, right in (("left_", "right_"), ("L_", "R_")):
        if name.startswith(left):
            return right + name[len(left) :]
        if name.startswith(right):
            return left + name[len(right) :]
    return name
