// The two wrist handles, and the ghost hands that show what the arms can do about them.

import { angleBetween, distance } from "./rotation.js";

const SIDES = ["left", "right"];
const SHOWN_APART = [0.015, 0.12]; // a ghost closer than this to the target is no news [m, rad]
const SETTLE = 3; // messages
const REASONS = {
  limit: "joint limit",
  collision: "the body is in the way",
  reach: "out of reach",
  solver: "no way there",
  invalid: "not a pose",
};

export class Wrists extends EventTarget {
  #sides;
  #pending = {};
  smooth = localStorage.getItem("teleop smooth wrists") === "yes"; // a mouse is exact, the filter would only delay it

  // Events: "drag", a handle moved and fields() has news; "idle-drag", one is dragged while the robot does not follow.
  constructor(viewer, stage, pilot, roles, link, names) {
    super();
    Object.assign(this, { viewer, stage, pilot, roles, link });
    this.#sides = names.map((name) => ({ ...name, dragged: false, settled: 0 }));
    viewer.addEventListener("drag", ({ detail }) => this.#drag(detail));
    viewer.addEventListener("scene", () => this.#sides.forEach((side) => (side.shown = {})));
    this.#sides.forEach((side) => (side.shown = {}));
  }

  // What the next message says about the wrists: the field `wrists`, or nothing.
  fields() {
    const wrists = this.#pending;
    this.#pending = {};
    return { smooth: this.smooth, ...(Object.keys(wrists).length ? { wrists } : {}) };
  }

  setSmooth(smooth) {
    this.smooth = smooth;
    localStorage.setItem("teleop smooth wrists", smooth ? "yes" : "no");
  }

  // Show an answer of the server.
  show(answer) {
    const usable = !this.stage.playback && this.roles.may("arms");
    const engaged = answer.roles.arms.state === "ENGAGED";
    this.#sides.forEach((side, i) => {
      const wrist = answer.wrists[SIDES[i]];
      const follows = engaged && !wrist.let_go;
      this.#visible(side, side.handle, usable);
      if (!side.dragged && answer.seq >= side.settled) this.#place(side, side.handle, follows ? wrist.target : wrist.reachable);
      this.#ghost(side, wrist, engaged && !this.stage.playback);
    });
  }

  #drag({ name, phase, position, quaternion }) {
    const i = this.#sides.findIndex((side) => side.handle === name);
    if (i < 0) return;
    const side = this.#sides[i];
    side.dragged = phase !== "DragEnd";
    side.shown[side.handle] = null; // it is where the pointer put it
    if (phase === "Update" && this.pilot.engaged) {
      this.#pending[SIDES[i]] = { position, quaternion };
      this.dispatchEvent(new Event("drag"));
      side.settled = this.link.seq + SETTLE; // until then the server's target may be an older one
    } else if (!this.pilot.engaged && phase === "DragStart") {
      this.dispatchEvent(new Event("idle-drag"));
    }
  }

  #ghost(side, wrist, active) {
    const { target, reachable, limited_by: limit, let_go: letGo } = wrist;
    const apart =
      distance(target.position, reachable.position) > SHOWN_APART[0] ||
      angleBetween(target.quaternion, reachable.quaternion) > SHOWN_APART[1];
    const why = letGo ? "let go: it jumped" : REASONS[limit];
    const shown = Boolean(active && apart && why);
    this.#visible(side, side.ghost, shown);
    this.#visible(side, side.reason, shown);
    if (!shown) return;
    this.#place(side, side.ghost, reachable);
    if (side.shown.why !== why) this.viewer.change(side.reason, { text: why });
    side.shown.why = why;
  }

  #place(side, name, pose) {
    const before = side.shown[name];
    if (before && distance(before.position, pose.position) < 1e-4 && angleBetween(before.quaternion, pose.quaternion) < 1e-3) return;
    side.shown[name] = pose;
    this.viewer.pose(name, pose.position, pose.quaternion);
  }

  #visible(side, name, visible) {
    if (side.shown[`${name} visible`] === visible) return;
    side.shown[`${name} visible`] = visible;
    this.viewer.visible(name, visible);
  }
}
