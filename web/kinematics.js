// Where every body is, from qpos: the same arithmetic as MuJoCo's mj_kinematics.

import { about, add, multiply, rotate, scale, subtract, unit } from "./rotation.js";

// Poses of all bodies in the world.
//   bodies: from GET /api/scene; parents come before their children.
//   qpos: numbers in MuJoCo's order.
// Returns [{position: [x, y, z], quaternion: [w, x, y, z]}, ...] in the order of bodies.
export function forward(bodies, qpos) {
  const poses = [];
  for (const body of bodies) {
    const parent = poses[body.parent] ?? { position: [0, 0, 0], quaternion: [1, 0, 0, 0] };
    let position = add(parent.position, rotate(parent.quaternion, body.position));
    let quaternion = multiply(parent.quaternion, body.quaternion);
    for (const joint of body.joints) {
      if (joint.type === "free") {
        position = Array.from(qpos.slice(joint.at, joint.at + 3));
        quaternion = unit(Array.from(qpos.slice(joint.at + 3, joint.at + 7)));
      } else if (joint.type === "slide") {
        position = add(position, rotate(quaternion, scale(joint.axis, qpos[joint.at] - joint.zero)));
      } else {
        const anchor = add(position, rotate(quaternion, joint.anchor));
        quaternion = multiply(quaternion, about(joint.axis, qpos[joint.at] - joint.zero));
        position = subtract(anchor, rotate(quaternion, joint.anchor));
      }
    }
    poses.push({ position, quaternion });
  }
  return poses;
}
