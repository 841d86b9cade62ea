// Where the head has to turn so that it looks at the hands.

import { add, rotate, scale, subtract } from "./rotation.js";

// {yaw, pitch} of the neck [rad].
//   description: from GET /api/scene; poses: of all bodies; wrists: of an Answer.
export function atHands(description, poses, { left, right }) {
  const { bodies, eye, pelvis } = description, neck = bodies[bodies[eye.body].parent];
  const middle = scale(add(left.actual.position, right.actual.position), 0.5);
  const target = add(poses[pelvis].position, rotate(poses[pelvis].quaternion, middle));
  const [w, x, y, z] = poses[neck.parent].quaternion;
  const from = poses[eye.body].position; // the joint that nods
  const [ahead, aside, above] = rotate([w, -x, -y, -z], subtract(target, from));
  return { yaw: Math.atan2(aside, Math.max(ahead, 0.05)), pitch: Math.atan2(-above, Math.hypot(ahead, aside)) };
}
