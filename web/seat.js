// Where a person in a headset is in the robot's world: behind it, or in its eyes.
//
// By default nothing moves the person's view but their own head. Behind the robot they stay where they are and are put behind it
// again, at once, when it has walked away. In its eyes they go along with it, level and softly, and turn with it in steps.

import { fromPose, inverse } from "./matrix.js";
import { about, add, multiply, rotate, subtract } from "./rotation.js";

const BEHIND = 1.5; // how far behind the robot one stands [m]
const AWAY = 1.2; // a robot that is this far from where it was is followed [m]
const STEP = Math.PI / 12; // by which the view turns along [rad]
const SOFT_S = 0.2;
const AXES = [0.5, -0.5, 0.5, 0.5]; // turns the robot's axes (x ahead, z up) into WebXR's (-z ahead, y up)

export class Seat {
  #spot = null; // a point of the robot's world, and the heading there: the person's own place and facing
  #home = { position: [0, 1.6, 0], yaw: 0 }; // of the person's head when they were seated
  view = "behind"; // behind, eyes
  smooth = false; // the view moves and turns with the robot all the time

  // description: from GET /api/scene.
  constructor(description) {
    this.description = description;
    this.head = new Set(description.bodies.flatMap(({ name }, i) => (name.startsWith("neck") ? [i] : [])));
  }

  // Bodies that would hide the view.
  get hidden() {
    return this.view === "eyes" ? this.head : null;
  }

  // Take the place anew: ahead is where the head looks now. head: {position, orientation} in WebXR's axes.
  recentre(head) {
    this.#spot = null;
    if (!head) return;
    const { x, y, z, w } = head.orientation, [ax, , az] = rotate([w, x, y, z], [0, 0, -1]);
    this.#home = { position: [head.position.x, head.position.y, head.position.z], yaw: Math.atan2(-ax, -az) };
  }

  // The matrix from the robot's world into WebXR's space.
  //   poses: of all bodies; elapsed: seconds since the last call.
  place(poses, elapsed) {
    const wanted = this.#wanted(poses);
    const share = this.#spot ? 1 - Math.exp(-elapsed / SOFT_S) : 1;
    const spot = (this.#spot ??= wanted);
    const far = Math.hypot(...subtract(wanted.position, spot.position)) > AWAY, turned = wrap(wanted.yaw - spot.yaw);
    if (this.smooth || this.view === "eyes") {
      spot.position = far ? wanted.position : spot.position.map((x, i) => x + share * (wanted.position[i] - x));
      if (this.smooth) spot.yaw += share * turned;
      else if (Math.abs(turned) > STEP) spot.yaw += STEP * Math.sign(turned);
    } else if (far) this.#spot = wanted;
    const { position: person, yaw } = this.#home;
    const at = this.view === "eyes" ? person : [person[0], 0, person[2]];
    const turn = multiply(about([0, 1, 0], yaw - this.#spot.yaw), AXES);
    return fromPose(subtract(at, rotate(turn, this.#spot.position)), turn);
  }

  // The robot's own camera, or one of its two eyes: where it is and how it is turned, as a matrix from the world into the eye.
  //   side: 0 the middle, -1 the left one, 1 the right one; apart: distance between them [m].
  camera(poses, side = 0, apart = 0.063) {
    const { eye } = this.description, head = poses[eye.body];
    const left = cross(eye.up, eye.forward);
    const spot = add(eye.position, left.map((x) => (-side * apart * x) / 2));
    const looks = multiply(head.quaternion, [0.5, 0.5, -0.5, -0.5]);
    return inverse(fromPose(add(head.position, rotate(head.quaternion, spot)), looks));
  }

  #wanted(poses) {
    const { pelvis, eye } = this.description, { position, quaternion } = poses[pelvis];
    const [x, y] = rotate(quaternion, [1, 0, 0]), yaw = Math.atan2(y, x);
    if (this.view !== "eyes") return { position: [position[0] - BEHIND * Math.cos(yaw), position[1] - BEHIND * Math.sin(yaw), 0], yaw };
    const head = poses[eye.body];
    return { position: add(head.position, rotate(head.quaternion, eye.position)), yaw };
  }
}

const wrap = (angle) => angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));
const cross = ([ax, ay, az], [bx, by, bz]) => [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx];
