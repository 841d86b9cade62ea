// Hands and head without a headset: sliders, a key a grasp, and a head that looks at the hands.

import { atHands } from "./gaze.js";

const SIDES = ["left", "right"];
const DRIVES = 6;
const ROOM = 0.5; // share of its way that a slider counts as closed

export class Hands {
  #gaze = false;

  // pinches: from GET /api/scene, or null.
  constructor($, pilot, stage, { pinches }) {
    Object.assign(this, { $, pilot, stage, pinches: pinches ?? SIDES.map(() => Array(DRIVES).fill(1)) });
    for (const side of SIDES)
      for (const grasp of ["grip", "pinch"]) this.#slider(`${grasp}-${side}`).addEventListener("input", () => this.#tellHands());
    for (const field of ["neck-yaw", "neck-pitch"]) this.#slider(field).addEventListener("input", () => this.#turn());
    $("#gaze").addEventListener("change", ({ target }) => (this.#gaze = target.checked));
  }

  // What keys do: a press closes, the next one opens.
  get actions() {
    const names = SIDES.flatMap((side) => [`grip-${side}`, `pinch-${side}`]);
    return Object.fromEntries(names.map((name) => [name, () => this.#toggle(name)]));
  }

  show(answer) {
    const { pilot, stage } = this;
    if (!this.#gaze || !pilot.engaged || !stage.poses) return;
    pilot.ask("neck", atHands(stage.description, stage.poses, answer.wrists));
  }

  #toggle(name) {
    const slider = this.#slider(name), closed = Number(slider.value) > ROOM;
    slider.value = closed ? 0 : 1;
    slider.dispatchEvent(new Event("input"));
  }

  #tellHands() {
    const drives = SIDES.map((side, i) => {
      const grip = this.#value(`grip-${side}`), pinch = this.#value(`pinch-${side}`);
      return this.pinches[i].map((way) => Math.max(grip, pinch * way));
    });
    this.pilot.ask("hands", { left: drives[0], right: drives[1] });
  }

  #turn() {
    this.#gaze = this.$("#gaze").checked = false;
    this.pilot.ask("neck", { yaw: this.#value("neck-yaw"), pitch: this.#value("neck-pitch") });
  }

  #slider(field) {
    return this.$(`[data-field=${field}]`);
  }

  #value(field) {
    return Number(this.#slider(field).value);
  }
}
