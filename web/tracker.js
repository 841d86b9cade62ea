// What a frame of a WebXR session knows of the operator: head, wrists, fingers, triggers, sticks.

const SIDES = { left: 0, right: 1 };
const NAMES = ["LEFT", "RIGHT"];
const JOINTS = 25, THUMB_TIP = 4, INDEX_TIP = 9;
const PINCHED = 0.015, OPENED = 0.03; // gaps between thumb and index tip [m]

export class Tracker {
  hands = [null, null]; // of this frame, left and right: {tip: index fingertip, pinch: true while thumb and index touch}
  wrists = [null, null]; // positions in this frame, [x, y, z]
  squeezed = [false, false]; // grips of controllers
  sticks = [null, null]; // thumbsticks of controllers [x to the right, y to the back]
  buttons = { engage: false, stop: false }; // A or X, and B or Y, of either controller
  head = null; // {position, orientation} of this frame, or null
  points = []; // of both hands, in this frame: joints of fingers, or where a controller is
  #pinched = [false, false];

  // Fill the packet with what this frame has seen. Returns the sides, 0 and 1, that a controller drives.
  //   space: a reference space whose floor is level.
  read(frame, space, packet) {
    const controllers = [];
    let valid = 0;
    this.hands = [null, null];
    this.wrists = [null, null];
    this.points = [];
    this.squeezed = [false, false];
    this.sticks = [null, null];
    this.buttons = { engage: false, stop: false };
    const head = frame.getViewerPose(space);
    this.head = head && !head.emulatedPosition ? head.transform : null;
    if (this.head) {
      packet.set("head", row(this.head));
      valid |= packet.seen.HEAD;
    }
    for (const source of frame.session.inputSources) {
      const side = SIDES[source.handedness];
      // a transient pointer (Vision Pro) is where somebody looked while they pinched, and no hand
      if (side === undefined || source.targetRayMode === "transient-pointer") continue;
      if (source.hand) valid |= this.#hand(frame, space, packet, source.hand, side);
      else if (source.gripSpace) {
        valid |= this.#controller(frame, space, packet, source, side);
        controllers.push(side);
      }
    }
    packet.set("valid", [valid]);
    return controllers;
  }

  #hand(frame, space, packet, hand, side) {
    const points = [];
    let wrist = null;
    for (const joint of hand.values()) {
      const pose = frame.getJointPose(joint, space);
      if (!pose) break;
      wrist ??= pose.transform;
      points.push(three(pose.transform.position));
    }
    if (!wrist) return 0;
    this.points.push(...points);
    packet.set("wrists", row(wrist), 7 * side);
    this.wrists[side] = three(wrist.position);
    let valid = packet.seen[`${NAMES[side]}_WRIST`];
    if (points.length === JOINTS) {
      packet.set("joints", points.flat(), 3 * JOINTS * side);
      valid |= packet.seen[`${NAMES[side]}_FINGERS`];
      const gap = Math.hypot(...points[THUMB_TIP].map((x, i) => x - points[INDEX_TIP][i]));
      const pinch = (this.#pinched[side] = gap < (this.#pinched[side] ? OPENED : PINCHED)); // no select event tells of a tracked hand
      this.hands[side] = { tip: points[INDEX_TIP], pinch };
    }
    return valid;
  }

  #controller(frame, space, packet, { gripSpace, gamepad }, side) {
    this.squeezed[side] = Boolean(gamepad?.buttons[1]?.pressed);
    this.sticks[side] = gamepad?.axes.length >= 4 ? [gamepad.axes[2], gamepad.axes[3]] : null;
    this.buttons.engage ||= Boolean(gamepad?.buttons[4]?.pressed);
    this.buttons.stop ||= Boolean(gamepad?.buttons[5]?.pressed);
    packet.set("grips", [gamepad?.buttons[0]?.value ?? 0], side);
    const pose = frame.getPose(gripSpace, space), grip = packet.seen[`${NAMES[side]}_GRIP`];
    if (!pose || pose.emulatedPosition) return grip; // out of the headset's sight: its place is a guess
    packet.set("wrists", row(pose.transform), 7 * side);
    this.wrists[side] = three(pose.transform.position);
    this.points.push(this.wrists[side]);
    return grip | packet.seen[`${NAMES[side]}_WRIST`];
  }
}

const three = ({ x, y, z }) => [x, y, z];
const row = ({ position, orientation: { x, y, z, w } }) => [...three(position), x, y, z, w];
