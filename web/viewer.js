// viser's scene, as far as this page changes it. Changes wait for flush(), so that one drawn frame never shows half of them.

import { rotate } from "./rotation.js";

export class Viewer extends EventTarget {
  #tap;
  #waiting = [];
  #theme = null; // viser's own theme message
  #up = [1, 0, 0, 0]; // how viser turns its world so that z is up
  #camera = null;
  ready = false;

  // tap: window.teleopTap. Events: "scene" (all of it is there, or there again), "drag" {name, phase, position, quaternion}.
  constructor(tap) {
    super();
    this.#tap = tap;
    tap.addEventListener("received", ({ detail }) => this.#overhear(detail));
    tap.addEventListener("sent", ({ detail }) => this.#answer(detail));
    tap.addEventListener("scene", () => {
      this.ready = true;
      this.dispatchEvent(new Event("scene"));
    });
  }

  pose(name, position, quaternion) {
    this.#waiting.push({ type: "SetPositionMessage", name, position }, { type: "SetOrientationMessage", name, wxyz: quaternion });
  }

  // Move the whole world under the camera, so that this point of it comes to the origin.
  centre(point) {
    const turned = rotate(this.#up, point);
    this.#waiting.push({ type: "SetPositionMessage", name: "", position: turned.map((v) => -v) });
  }

  visible(name, visible) {
    this.#waiting.push({ type: "SetSceneNodeVisibilityMessage", name, visible });
  }

  // Change properties of a scene node, as they are called in viser's _messages.py.
  change(name, updates) {
    this.#waiting.push({ type: "SceneNodeUpdateMessage", name, updates });
  }

  look(position, at, fov) {
    this.#waiting.push({ type: "SetCameraPositionMessage", position, initial: false });
    this.#waiting.push({ type: "SetCameraLookAtMessage", look_at: at, initial: false });
    if (fov !== undefined) this.#waiting.push({ type: "SetCameraFovMessage", fov, initial: false });
  }

  // Where the user looks from: {position, at} in the world, or null before the first frame.
  get camera() {
    return this.#camera;
  }

  dark(dark) {
    if (this.#theme) this.#waiting.push({ ...this.#theme, dark_mode: dark });
  }

  shadows(shadows) {
    this.#waiting.push({ type: "EnableLightsMessage", enabled: true, cast_shadow: shadows });
  }

  flush() {
    if (!this.ready || !this.#waiting.length) return;
    this.#tap.deliver(this.#waiting);
    this.#waiting = [];
  }

  #overhear(messages) {
    for (const message of messages) {
      if (message.type === "ThemeConfigurationMessage") this.#theme = message;
      if (message.type === "SetOrientationMessage" && message.name === "") this.#up = message.wxyz;
    }
  }

  #answer(message) {
    if (message.type === "ViewerCameraMessage") this.#camera = { position: message.position, at: message.look_at };
    const phase = /^TransformControls(DragStart|Update|DragEnd)Message$/.exec(message.type)?.[1];
    if (!phase) return;
    const detail = { name: message.name, phase, position: message.position, quaternion: message.wxyz };
    this.dispatchEvent(new CustomEvent("drag", { detail }));
  }
}
