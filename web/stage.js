// Moves the picture: once a drawn frame, the newest qpos and the camera.

import { forward } from "./kinematics.js";
import { add, distance, rotate, subtract } from "./rotation.js";

const FOLLOW_S = 0.25; // how softly the view follows
const TELEPORT = 1.5; // a robot that moved further than this between two frames was put there [m]
const FOV = (40 * Math.PI) / 180;
// Where one looks from at first; the pedals lie over the lower part of the view, on a phone over nearly half of it.
const WIDE = { position: [3.05, -1.95, 1.55], at: [0, 0, 0.71] };
const TALL = { position: [3.9, -2.5, 1.6], at: [0, 0, 0.42] };

export class Stage extends EventTarget {
  #view = "follow";
  #centre = null; // the point of the floor that the user looks around
  #before = null; // the camera before the robot's-eye view, relative to the centre
  #then = 0;
  poses = null;
  playback = null; // an Episode, or null

  // description: from GET /api/scene.
  constructor(viewer, description, live) {
    super();
    Object.assign(this, { viewer, description, live });
    viewer.addEventListener("scene", () => this.#redraw());
    if (viewer.ready) this.#redraw();
    const draw = (now) => {
      this.#draw(now);
      requestAnimationFrame(draw);
    };
    requestAnimationFrame(draw);
  }

  get view() {
    return this.#view;
  }

  // "follow": the view walks with the robot and the user looks around it. "eyes": what the robot's camera sees. "free": it stays.
  set view(view) {
    const { viewer } = this;
    if (view === "eyes" && this.#view !== "eyes" && viewer.camera && this.#centre) {
      this.#before = { position: subtract(viewer.camera.position, this.#centre), at: subtract(viewer.camera.at, this.#centre) };
    }
    const left = this.#view === "eyes" && view !== "eyes";
    this.#view = view;
    if (left) this.#lookFrom(this.#before ?? this.#home);
    this.dispatchEvent(new Event("view"));
  }

  // Back to where the view was at first.
  recentre() {
    this.#centre = null;
    this.view = "follow";
    this.#lookFrom(this.#home);
  }

  // Show an episode instead of the robot; null: the robot again.
  play(episode) {
    this.playback = episode;
    this.#centre = null;
    this.#redraw();
    this.dispatchEvent(new Event("playback"));
  }

  get #home() {
    return innerWidth < innerHeight * 0.8 ? TALL : WIDE;
  }

  #lookFrom({ position, at }) {
    this.#follow(1e3);
    const centre = this.#centre ?? [0, 0, 0];
    this.viewer.look(add(position, centre), add(at, centre), FOV);
  }

  // Everything again: the scene was sent anew, or shows something else.
  #redraw() {
    const qpos = this.playback ? null : this.live.newest;
    if (qpos) this.#show(qpos);
    if (this.#centre) this.viewer.centre(this.#centre);
    else this.#lookFrom(this.#home);
  }

  #draw(now) {
    const elapsed = Math.min(1, (now - this.#then) / 1000);
    this.#then = now;
    if (!this.viewer.ready) return;
    const qpos = (this.playback ?? this.live).next(now);
    if (qpos) this.#show(qpos);
    if (this.poses) this.#view === "eyes" ? this.#see() : this.#view === "follow" && this.#follow(elapsed);
    this.viewer.flush();
  }

  #show(qpos) {
    this.poses = forward(this.description.bodies, qpos);
    this.description.bodies.forEach(({ node }, i) => {
      if (node) this.viewer.pose(node, this.poses[i].position, this.poses[i].quaternion);
    });
  }

  #follow(elapsed) {
    if (!this.poses) return;
    const [x, y] = this.poses[this.description.pelvis].position;
    const goal = [x, y, 0];
    const far = !this.#centre || distance(goal, this.#centre) > TELEPORT;
    const share = far ? 1 : 1 - Math.exp(-elapsed / FOLLOW_S);
    const before = this.#centre ?? goal;
    this.#centre = before.map((v, i) => v + share * (goal[i] - v));
    this.viewer.centre(this.#centre);
  }

  #see() {
    const { eye } = this.description, head = this.poses[eye.body];
    const from = add(head.position, rotate(head.quaternion, eye.position));
    this.viewer.look(from, add(from, rotate(head.quaternion, eye.forward)), eye.fov);
  }
}
