"""The H1 as numbers: six-axis legs, a waist, two seven-axis arms, Inspire hands and a two-axis neck.

Kinematics, inertia and limits of the body: OpenTeleVision h1_inspire (Apache-2.0), the paper authors' own robot
description. Hands: Unitree's H1-2 description (BSD-3) with TeleVision's thumb range. Gains: Unitree's H1-2 deployment.
The neck has no published numbers; its frames are ours. Right legs and arms are the left ones mirrored in the sagittal
plane; the hands are two measured tables because their frames differ.
"""

from __future__ import annotations

from dataclasses import replace

from robots.spec import Body, Group, Hand, Joint, RobotSpec, Vec

# fmt: off
# name, parent, position, quaternion wxyz, mass, centre of mass, inertia (xx yy zz xy xz yz)
_CENTRE_AND_LEFT = (
    Body("pelvis", None, (0, 0, 0), (1, 0, 0, 0), 5.39, (-0.0002, 4e-05, -0.04522), (0.044582, 0.0082464, 0.049021, 8.7034e-05, -1.9893e-05, 4.021e-06)),
    Body("left_hip_yaw_link", "pelvis", (0, 0.0875, -0.1742), (1, 0, 0, 0), 2.244, (-0.04923, 0.0001, 0.0072), (0.0025731, 0.0030444, 0.0022883, 9.159e-06, -0.00051948, 1.949e-06)),
    Body("left_hip_roll_link", "left_hip_yaw_link", (0.039468, 0, 0), (1, 0, 0, 0), 2.232, (-0.0058, -0.00319, -9e-05), (0.0020603, 0.0022482, 0.0024323, 3.2115e-05, 2.878e-06, -7.813e-06)),
    Body("left_hip_pitch_link", "left_hip_roll_link", (0, 0.11536, 0), (1, 0, 0, 0), 4.152, (0.00746, -0.02346, -0.08193), (0.082618, 0.081579, 0.0060081, -0.00066654, 0.0040725, 0.0072024)),
    Body("left_knee_link", "left_hip_pitch_link", (0, 0, -0.4), (1, 0, 0, 0), 3.768, (0.000923, -0.00042, -0.183981), (0.0335517, 0.03355378, 0.004711191, 5.7076e-05, -0.000458991, 1.141e-05)),
    Body("left_ankle_pitch_link", "left_knee_link", (0, 0, -0.4), (1, 0, 0, 0), 0.102, (-0.000294, 0, -0.010794), (2.3944e-05, 2.1837e-05, 1.3414e-05, 0, 1.21e-07, 0)),
    Body("left_ankle_roll_link", "left_ankle_pitch_link", (0, 0, -0.02), (1, 0, 0, 0), 1.768, (0.033731, 0.000501, -0.018756), (0.001966846, 0.01198526, 0.01285654, -2.9758e-05, 0.000516762, -7.289e-06)),
    Body("torso_link", "pelvis", (0, 0, 0), (1, 0, 0, 0), 17.789, (0.000489, 0.002797, 0.20484), (0.4873, 0.40963, 0.12785, -0.00053763, 0.0020276, -0.00074582)),
    Body("left_shoulder_pitch_link", "torso_link", (0.0055, 0.15535, 0.42999), (0.9762963, 0.2164385, 0, 0), 1.033, (0.005045, 0.053657, -0.015715), (0.0012985, 0.00087279, 0.00097338, -1.7333e-05, 8.683e-06, 3.9656e-05)),
    Body("left_shoulder_roll_link", "left_shoulder_pitch_link", (-0.0055, 0.0565, -0.0165), (0.9762963, -0.2164385, 0, 0), 0.793, (0.000679, 0.00115, -0.094076), (0.0015742, 0.0016973, 0.0010183, 2.298e-06, -7.2265e-05, -6.3691e-05)),
    Body("left_shoulder_yaw_link", "left_shoulder_roll_link", (0, 0, -0.1343), (1, 0, 0, 0), 0.839, (0.01365, 0.002767, -0.16266), (0.003664, 0.0040789, 0.00066383, -1.0671e-05, 0.00034733, 7.0213e-05)),
    Body("left_elbow_pitch_link", "left_shoulder_yaw_link", (0.0185, 0, -0.198), (1, 0, 0, 0), 0.676, (0.075854, 0.0002, -0.013485), (0.000314529, 0.000890865, 0.000906729, -1.1375e-05, 8.4762e-05, 5.78e-07)),
    Body("left_elbow_roll_link", "left_elbow_pitch_link", (0.121, 0, -0.015), (1, 0, 0, 0), 0.683, (0.035281, -0.00232, 0.000337), (0.000313275, 0.000310412, 0.000345998, 1.6521e-05, -2.501e-06, 5.435e-06)),
    Body("left_wrist_pitch_link", "left_elbow_roll_link", (0.085, 0, 0), (1, 0, 0, 0), 0.484, (0.020395, 3.6e-05, -0.002973), (7.1364e-05, 6.9915e-05, 7.0702e-05, 3.08e-07, 1.485e-06, -8.8e-08)),
    Body("left_wrist_yaw_link", "left_wrist_pitch_link", (0.02, 0, 0), (1, 0, 0, 0), 0.086, (0.02609, 0, 0), (7.3879e-05, 6.8528e-05, 4.1945e-05, 0, 0, 0)),
)

_HANDS = (
    Body("L_hand_base_link", "left_wrist_yaw_link", (0.0365, 0, 0), (0.7071068, 0, 0, 0.7071068), 0.14143, (-0.002551, -0.066047, -0.0019357), (0.0001234, 8.3835e-05, 7.7231e-05, 2.1995e-06, -1.7694e-06, 1.5968e-06)),
    Body("L_thumb_proximal_base", "L_hand_base_link", (-0.01696, -0.0691, 0.02045), (0.4999982, 0.5, -0.5, 0.5000018), 0.0018869, (0.0048817, 0.00038782, -0.00722), (5.5158e-08, 8.2164e-08, 6.7434e-08, -1.1803e-08, -4.6743e-09, -1.3521e-09)),
    Body("L_thumb_proximal", "L_thumb_proximal_base", (0.0099867, 0.0098242, -0.0089), (0.7045709, -0.7045735, -0.05981695, 0.05981673), 0.0066101, (0.021936, -0.01279, -0.0080386), (1.5693e-06, 1.7356e-06, 2.787e-06, 7.8339e-07, 8.5959e-10, 1.0378e-09)),
    Body("L_thumb_intermediate", "L_thumb_proximal", (0.04407, -0.034553, -0.0008), (1, 0, 0, 0), 0.0037844, (0.0095531, 0.0016282, -0.0072002), (3.6981e-07, 3.2395e-07, 4.6532e-07, 9.8603e-08, -2.8173e-12, -2.8028e-12)),
    Body("L_thumb_distal", "L_thumb_intermediate", (0.020248, -0.010156, -0.0012), (1, 0, 0, 0), 0.003344, (0.0092888, -0.004953, -0.0060033), (1.3632e-07, 1.4052e-07, 2.0026e-07, 5.6787e-08, -9.1939e-11, 1.2145e-10)),
    Body("L_index_proximal", "L_hand_base_link", (0.00028533, -0.13653, 0.032268), (0.9998477, -0.01745261, 0, 0), 0.0042405, (0.0012971, -0.011934, -0.0059998), (6.6215e-07, 2.1167e-07, 6.9402e-07, 1.8442e-08, 1.3746e-12, -1.4773e-11)),
    Body("L_index_intermediate", "L_index_proximal", (-0.0024229, -0.032041, -0.001), (1, 0, 0, 0), 0.0045682, (0.0021753, -0.019567, -0.005), (7.6284e-07, 9.4308e-08, 7.8176e-07, -8.063e-08, 0, 0)),
    Body("L_middle_proximal", "L_hand_base_link", (0.00028533, -0.1371, 0.01295), (1, 0, 0, 0), 0.0042405, (0.0012971, -0.011934, -0.0059999), (6.6215e-07, 2.1167e-07, 6.9402e-07, 1.8442e-08, 1.2299e-12, -1.4484e-11)),
    Body("L_middle_intermediate", "L_middle_proximal", (-0.0024229, -0.032041, -0.001), (1, 0, 0, 0), 0.0050397, (0.001921, -0.020796, -0.0049999), (9.5823e-07, 1.0646e-07, 9.8385e-07, -1.1425e-07, -2.4186e-12, 3.6974e-12)),
    Body("L_ring_proximal", "L_hand_base_link", (0.00028533, -0.13691, -0.0062872), (0.9996573, 0.02617701, 0, 0), 0.0042405, (0.0012971, -0.011934, -0.0059999), (6.6215e-07, 2.1167e-07, 6.9402e-07, 1.8442e-08, 0, -1.4124e-11)),
    Body("L_ring_intermediate", "L_ring_proximal", (-0.0024229, -0.032041, -0.001), (1, 0, 0, 0), 0.0045682, (0.0021753, -0.019567, -0.005), (7.6285e-07, 9.4308e-08, 7.8176e-07, -8.0631e-08, 0, 0)),
    Body("L_pinky_proximal", "L_hand_base_link", (0.00028533, -0.13571, -0.025488), (0.9986295, 0.05233608, 0, 0), 0.0042405, (0.0012971, -0.011934, -0.0059999), (6.6215e-07, 2.1167e-07, 6.9402e-07, 1.8442e-08, 1.0279e-12, -1.4277e-11)),
    Body("L_pinky_intermediate", "L_pinky_proximal", (-0.0024229, -0.032041, -0.001), (1, 0, 0, 0), 0.0036036, (0.0024788, -0.016208, -0.0050001), (4.3923e-07, 7.0315e-08, 4.4881e-07, -4.1355e-08, 1.2263e-12, 3.1311e-12)),
    Body("R_hand_base_link", "right_wrist_yaw_link", (0.0365, 0, 0), (0, 0.7071068, -0.7071068, 0), 0.14143, (-0.0025264, -0.066047, 0.0019598), (0.00012281, 8.3832e-05, 7.6663e-05, 2.1711e-06, 1.7709e-06, -1.6551e-06)),
    Body("R_thumb_proximal_base", "R_hand_base_link", (-0.01696, -0.0691, -0.02045), (0.4999982, 0.5, -0.5, 0.5000018), 0.0018869, (-0.0048064, 0.0009382, -0.00757), (5.816e-08, 7.9161e-08, 6.7433e-08, 1.4539e-08, 4.491e-09, -1.8727e-09)),
    Body("R_thumb_proximal", "R_thumb_proximal_base", (-0.0088099, 0.010892, -0.00925), (0.0996843, 0.09968466, 0.7000463, 0.7000437), 0.0066075, (0.021932, 0.012785, -0.0080386), (1.5686e-06, 1.7353e-06, 2.786e-06, -7.8296e-07, 8.9143e-10, -1.0191e-09)),
    Body("R_thumb_intermediate", "R_thumb_proximal", (0.04407, 0.034553, -0.0008), (1, 0, 0, 0), 0.0037847, (0.0095544, -0.0016282, -0.0071997), (3.6981e-07, 3.2394e-07, 4.6531e-07, -9.8581e-08, -4.7469e-12, 1.0939e-12)),
    Body("R_thumb_distal", "R_thumb_intermediate", (0.020248, 0.010156, -0.0012), (1, 0, 0, 0), 0.0033441, (0.0092888, 0.0049529, -0.0060033), (1.3632e-07, 1.4052e-07, 2.0026e-07, -5.6788e-08, -9.2764e-11, -1.2283e-10)),
    Body("R_index_proximal", "R_hand_base_link", (0.00028533, -0.13653, -0.032268), (0.01744544, -0.9998478, 0, 0), 0.0042403, (0.0012259, 0.011942, -0.0060001), (6.6232e-07, 2.1146e-07, 6.9398e-07, -1.5775e-08, 1.8515e-12, -5.0828e-12)),
    Body("R_index_intermediate", "R_index_proximal", (-0.0026138, 0.032026, -0.001), (1, 0, 0, 0), 0.0045683, (0.0019697, 0.019589, -0.005), (7.6111e-07, 9.6076e-08, 7.8179e-07, 8.7637e-08, 0, 0)),
    Body("R_middle_proximal", "R_hand_base_link", (0.00028533, -0.1371, -0.01295), (3.673205e-06, 1, 0, 0), 0.0042403, (0.001297, 0.011934, -0.0060001), (6.6211e-07, 2.1167e-07, 6.9397e-07, -1.8461e-08, 1.8002e-12, -6.6808e-12)),
    Body("R_middle_intermediate", "R_middle_proximal", (-0.0024229, 0.032041, -0.001), (1, 0, 0, 0), 0.0050396, (0.001921, 0.020796, -0.005), (9.5822e-07, 1.0646e-07, 9.8384e-07, 1.1425e-07, -2.4791e-12, 5.9173e-12)),
    Body("R_ring_proximal", "R_hand_base_link", (0.00028533, -0.13691, 0.0062872), (0.02619333, 0.9996569, 0, 0), 0.0042403, (0.001297, 0.011934, -0.0060002), (6.6211e-07, 2.1167e-07, 6.9397e-07, -1.8461e-08, 1.5793e-12, -6.6868e-12)),
    Body("R_ring_intermediate", "R_ring_proximal", (-0.0024229, 0.032041, -0.001), (1, 0, 0, 0), 0.0045683, (0.0021753, 0.019567, -0.005), (7.6286e-07, 9.431e-08, 7.8177e-07, 8.0635e-08, 0, 0)),
    Body("R_pinky_proximal", "R_hand_base_link", (0.00028533, -0.13571, 0.025488), (0.05232242, 0.9986302, 0, 0), 0.0042403, (0.001297, 0.011934, -0.0060001), (6.6211e-07, 2.1167e-07, 6.9397e-07, -1.8461e-08, 1.6907e-12, -6.9334e-12)),
    Body("R_pinky_intermediate", "R_pinky_proximal", (-0.0024229, 0.032041, -0.001), (1, 0, 0, 0), 0.0035996, (0.0024748, 0.016203, -0.0050031), (4.3913e-07, 7.0247e-08, 4.4867e-07, 4.1418e-08, 3.7168e-11, 5.8613e-11)),
)

# fmt: on

_NECK = (
    Body("neck_yaw_link", "torso_link", (0.095, 0, 0.748), (1, 0, 0, 0), 0.06, (0, 0, 0.02), (2e-05, 2e-05, 2e-05, 0, 0, 0)),
    Body("neck_pitch_link", "neck_yaw_link", (0, 0, 0.045), (1, 0, 0, 0), 0.12, (0.02, 0, 0.01), (6e-05, 6e-05, 6e-05, 0, 0, 0)),
)

EYES = {"left": (0.045, 0.0315, 0.012), "right": (0.045, -0.0315, 0.012)}
"""Camera positions in the neck pitch frame [m]; x forward, z up; field of view 70 degrees."""

SOLE_SPHERES = ((-0.083, 0.035, -0.04), (-0.083, -0.035, -0.04), (0.18, 0.035, -0.04), (0.18, -0.035, -0.04))
"""Contact spheres of a foot in the ankle roll frame [m]; radius 0.01."""

FINGERTIPS = {
    "thumb": ("thumb_distal", (0.015, -0.013, -0.004)),
    "index": ("index_intermediate", (-0.005, -0.04, -0.004)),
    "middle": ("middle_intermediate", (-0.005, -0.045, -0.004)),
    "ring": ("ring_intermediate", (-0.002, -0.04, -0.004)),
    "pinky": ("pinky_intermediate", (-0.002, -0.032, -0.004)),
}
"""Finger -> (link without its side, tip in that link's frame on the left hand [m]; y changes sign on the right)."""


def _mirrored(body: Body) -> Body:
    def side(name: str | None) -> str | None:
        return name and name.replace("left_", "right_")

    (x, y, z), (w, qx, qy, qz), (cx, cy, cz), (xx, yy, zz, xy, xz, yz) = body.pos, body.quat, body.com, body.inertia
    pos, quat, com = (x, -y, z), (w, -qx, qy, -qz), (cx, -cy, cz)
    return Body(side(body.name) or "", side(body.parent), pos, quat, body.mass, com, (xx, yy, zz, -xy, xz, -yz))


def _bodies() -> tuple[Body, ...]:
    # TeleVision's right links are exact mirrors too, but for three links from elbow to wrist: there it repeats the left's
    # centre of mass and inertia without changing signs (up to 4.6 mm), which this table does not
    right = tuple(_mirrored(b) for b in _CENTRE_AND_LEFT if b.name.startswith("left_"))
    return _CENTRE_AND_LEFT + right + _HANDS + _NECK


X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)

# joint, axis, lower, upper, effort, speed, kp, kd, home, armature. Home narrows the stance to 0.23 m between the soles:
# at hip roll 0 they are 0.41 m apart, and a pendulum that steps every 0.4 s then sways at 0.19 m/s on average. Knees are
# bent so that the soles lie under the centre of mass at the nominal height.
_LEG = (
    ("hip_yaw", Z, -0.43, 0.43, 200, 23, 200, 2.5, 0.0, 0.02),
    ("hip_roll", X, -0.43, 0.43, 200, 23, 200, 2.5, -0.1, 0.02),
    ("hip_pitch", Y, -3.14, 2.53, 200, 23, 200, 2.5, -0.25, 0.02),
    ("knee", Y, -0.26, 2.05, 300, 14, 300, 4, 0.6, 0.03),
    ("ankle_pitch", Y, -0.897334, 0.523598, 60, 9, 60, 2, -0.35, 0.01),
    ("ankle_roll", X, -0.261799, 0.261799, 40, 9, 40, 2, 0.1, 0.01),
)
_ARM = (
    ("shoulder_pitch", Y, -2.44, 1.44, 40, 9, 140, 3, 0.1, 0.015),
    ("shoulder_roll", X, -0.17, 3.11, 40, 9, 140, 3, 0.15, 0.015),
    ("shoulder_yaw", Z, -1.3, 1.3, 18, 20, 120, 2, 0.0, 0.01),
    ("elbow_pitch", Y, -1.25, 1.57, 18, 20, 100, 2, 0.3, 0.01),
    ("elbow_roll", X, -1.57, 1.57, 19, 31.4, 50, 1, 0.0, 0.005),
    ("wrist_pitch", Y, -0.471, 0.349, 19, 31.4, 50, 1, 0.0, 0.005),
    ("wrist_yaw", Z, -1.012, 1.012, 19, 31.4, 50, 1, 0.0, 0.005),
)


def _limb(side: str, rows: tuple, group: Group) -> tuple[Joint, ...]:
    joints = []
    for name, axis, lower, upper, effort, speed, kp, kd, home, armature in rows:
        if side == "right" and axis != Y:  # rolls and yaws turn the other way
            lower, upper, home = -upper, -lower, -home
        joints.append(
            Joint(f"{side}_{name}_joint", f"{side}_{name}_link", axis, lower, upper, effort, speed, group, kp, kd, home, armature)
        )
    return tuple(joints)


def _hand(side: str) -> tuple[Joint, ...]:
    """Twelve finger joints of one Inspire hand: six driven, six that follow."""
    close: Vec = (0, 0, -1) if side == "L" else (0, 0, 1)
    turn: Vec = (0, 0, 1) if side == "L" else (0, 0, -1)

    def joint(name: str, body: str, axis: Vec, upper: float, lower: float = 0.0, mimic: tuple[str, float] | None = None) -> Joint:
        drive = Joint(f"{side}_{name}_joint", f"{side}_{body}", axis, lower, upper, 1.0, 8.0, "hands", 2.0, 0.05, 0.0, 0.002, 0.05)
        return replace(drive, mimic=(f"{side}_{mimic[0]}_joint", mimic[1]), kp=0.0, kd=0.0) if mimic else drive

    thumb = (
        joint("thumb_proximal_yaw", "thumb_proximal_base", turn, 1.3, -0.1),
        joint("thumb_proximal_pitch", "thumb_proximal", close, 0.5),
    )
    fingers = ("index", "middle", "ring", "pinky")
    driven = tuple(joint(f"{f}_proximal", f"{f}_proximal", close, 1.7) for f in fingers)
    tips = tuple(joint(f"{f}_intermediate", f"{f}_intermediate", close, 1.7, mimic=(f"{f}_proximal", 1.0)) for f in fingers)
    follow = (
        joint("thumb_intermediate", "thumb_intermediate", close, 0.8, mimic=("thumb_proximal_pitch", 1.6)),
        joint("thumb_distal", "thumb_distal", close, 1.2, mimic=("thumb_proximal_pitch", 2.4)),
    )
    return thumb + driven + follow + tips


def _hand_frames(side: str) -> Hand:
    thumb, *others = FINGERTIPS
    knuckles = (f"{side}_{thumb}_proximal_base", *(f"{side}_{finger}_proximal" for finger in others))
    tips = tuple(f"{side}_{finger}_tip" for finger in FINGERTIPS)
    yaw = 0.92 if side == "L" else 0.85  # the zeros of the thumbs differ
    return Hand(f"{side}_hand_base_link", knuckles, tips, pinch=(yaw, 0.52, 0.51, 0, 0, 0))


def _joints() -> tuple[Joint, ...]:
    hands = _hand("L") + _hand("R")
    waist = Joint("torso_joint", "torso_link", Z, -2.35, 2.35, 200, 23, "waist", 300, 5, 0.0, 0.02)
    neck = (
        Joint("neck_yaw_joint", "neck_yaw_link", Z, -1.57, 1.57, 4, 8, "neck", 10, 0.5, 0.0, 0.005),
        Joint("neck_pitch_joint", "neck_pitch_link", Y, -0.9, 1.2, 4, 8, "neck", 10, 0.5, 0.3, 0.005),
    )
    return (
        _limb("left", _LEG, "legs")
        + _limb("right", _LEG, "legs")
        + (waist,)
        + _limb("left", _ARM, "arms")
        + _limb("right", _ARM, "arms")
        + tuple(j for j in hands if j.mimic is None)
        + neck
        + tuple(j for j in hands if j.mimic is not None)
    )


H1 = RobotSpec(
    name="h1",
    bodies=_bodies(),
    joints=_joints(),
    nominal_height=1.0,
    policy_rate=50.0,
    wrists=("left_wrist", "right_wrist"),
    feet=("left_sole", "right_sole"),
    hands=(_hand_frames("L"), _hand_frames("R")),
)
