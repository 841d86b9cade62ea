// Hands and head without a headset: sliders, a key a grasp, and a head that looks at the hands.

import { atHands } from "./gaze.js";

const SIDES = ["left", "right"];
const DRIVES = 6;
const ROOM = 0.5; // share of its way that a slider counts as closed
const ALIKE = 0.01; // drives that differ by less close alike

export class Hands {
  #gaze = false;

  // pinches: from GET /api/scene, or null.
  constructor($, pilot, stage, { pinches }) {
    Object.assign(this, { $, pilot, stage, pinches: pinches ?? SIDES.map(() => Array(DRIVES).fill(1)) });
    for (const side of SIDES)
      for (const kind of ["grip", "pinch"]) this.#slider(`${kind}-${side}`).addEventListener("input", () => this.#tellHand(side));
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

  // What the sliders say about a robot whose hands and neck are like this: field -> number.
  fields({ hands, neck }) {
    const shown = { "neck-yaw": neck.yaw, "neck-pitch": neck.pitch };
    SIDES.forEach((side, i) => {
      const { grip, pinch } = grasp(hands[side], this.pinches[i]);
      Object.assign(shown, { [`grip-${side}`]: grip, [`pinch-${side}`]: pinch });
    });
    return shown;
  }

  #toggle(name) {
    const slider = this.#slider(name), closed = Number(slider.value) > ROOM;
    slider.value = closed ? 0 : 1;
    slider.dispatchEvent(new Event("input"));
  }

  #tellHand(side) {
    const grip = this.#value(`grip-${side}`), pinch = this.#value(`pinch-${side}`);
    const drives = this.pinches[SIDES.indexOf(side)].map((way) => Math.max(grip, pinch * way));
    this.pilot.ask("hands", { [side]: drives });
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

// How far a hand grips and pinches whose drives are closed like this; ways: how far a pinch closes each.
function grasp(drives, ways) {
  const grip = Math.min(...drives);
  const pinch = Math.min(...drives.map((closed, drive) => (closed > grip + ALIKE ? closed / ways[drive] : Infinity)));
  return { grip, pinch: Number.isFinite(pinch) ? pinch : 0 };
}
