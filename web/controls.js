// Buttons, pedals and sliders: what a hand on the page does to the pilot.

import { label } from "./keys.js";
import { ROLES } from "./roles.js";

const FIELDS = { legs: ["height", "roll", "pitch"], arms: ["waist", "grip-left", "grip-right", "pinch-left", "pinch-right", "neck-yaw", "neck-pitch"] };
const HINT_MS = 4000;
const DEGREES = 180 / Math.PI;

export class Controls {
  #timer = 0;

  // devices: [Keys, Pads].
  constructor($, pilot, devices, actions) {
    const [keys, pads] = devices;
    Object.assign(this, { $, pilot, keys, pads, actions });
    this.#engage();
    this.#pedals();
    devices.forEach((device) => pilot.listen(device, actions));
    this.#sliders();
    this.#safety();
    pilot.addEventListener("refused", ({ detail }) => this.hint(detail, true));
    pilot.addEventListener("change", () => this.#lit());
    $("#stop").addEventListener("pointerdown", () => actions.stop());
    $("#stop").addEventListener("click", (event) => event.detail === 0 && actions.stop()); // by Enter or an assistive tool
    $("#reset").addEventListener("click", () => actions.reset());
    this.keycaps();
  }

  // A sentence over the pedals, for a while or for good.
  hint(sentence, briefly = false) {
    const hint = this.$("#hint");
    hint.textContent = sentence;
    hint.classList.toggle("alert", briefly);
    clearTimeout(this.#timer);
    if (briefly) this.#timer = setTimeout(() => this.hint(""), HINT_MS);
  }

  // Sliders follow the robot while this page does not move them. values: field -> number.
  follow(values) {
    const { engaged, roles } = this.pilot;
    for (const role of ROLES) {
      for (const field of FIELDS[role]) {
        const input = this.$(`[data-field=${field}]`);
        input.disabled = !roles.may(role);
        if (!engaged || input.disabled) this.#set(input, values[field]);
      }
    }
  }

  keycaps() {
    for (const cap of this.$.all("[data-keys]")) {
      const [code] = this.keys.of(cap.dataset.keys);
      cap.textContent = code ? label(code) : "";
    }
  }

  #engage() {
    const button = this.$("#engage");
    button.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      button.setPointerCapture(event.pointerId);
      this.pilot.press();
    });
    button.addEventListener("pointerup", () => this.pilot.release());
    button.addEventListener("pointercancel", () => this.pilot.letGo());
    button.addEventListener("click", (event) => event.detail === 0 && (this.pilot.press(), this.pilot.release())); // a tap: Enter, or an assistive tool
    button.addEventListener("contextmenu", (event) => event.preventDefault()); // a long touch is a hold
    this.$("#latch").checked = this.pilot.latch;
    this.$("#latch").addEventListener("change", ({ target }) => this.pilot.setLatch(target.checked));
  }

  #pedals() {
    for (const pedal of this.$.all(".pedal")) {
      const { direction } = pedal.dataset, by = `pedal ${direction}`;
      pedal.addEventListener("pointerdown", (event) => {
        if (event.button !== 0) return;
        pedal.setPointerCapture(event.pointerId);
        this.pilot.hold(by, direction);
      });
      for (const end of ["pointerup", "lostpointercapture"]) pedal.addEventListener(end, () => this.pilot.drop(by));
      pedal.addEventListener("pointercancel", () => this.pilot.letGo());
      pedal.addEventListener("contextmenu", (event) => event.preventDefault());
    }
  }

  #sliders() {
    for (const input of this.$.all("[data-field]")) {
      input.value = this.pilot.limits[input.dataset.field] ?? this.pads[input.dataset.field] ?? input.value;
      this.#figure(input);
      input.addEventListener("input", () => {
        this.#figure(input);
        this.#ask(input.dataset.field, Number(input.value));
      });
      input.addEventListener("pointerup", () => input.blur()); // so that the arrow keys walk again
    }
    this.$("#straight").addEventListener("click", () => {
      for (const [field, value] of Object.entries({ height: 1, pitch: 0, roll: 0, waist: 0 })) {
        this.#set(this.$(`[data-field=${field}]`), value);
        this.#ask(field, value);
      }
    });
  }

  #ask(field, value) {
    const { pilot, pads } = this;
    if (field in pilot.limits) return pilot.setLimit(field, value);
    if (field in pads) return pads.set(field, value);
    if (/^(grip|pinch|neck)-/.test(field)) return; // web/hands.js
    pilot.ask(field, value);
  }

  #set(input, value) {
    if (Math.abs(Number(input.value) - value) < Number(input.step) / 2) return;
    input.value = value;
    this.#figure(input);
  }

  #figure(input) {
    const { unit } = input.dataset, value = Number(input.value);
    const shown = unit === "°" ? (value * DEGREES).toFixed(0) : unit === "%" ? (value * 100).toFixed(0) : value.toFixed(2);
    input.previousElementSibling.textContent = `${shown.replace(/^-0$/, "0")} ${unit}`.replace(" °", "°");
    const share = (value - input.min) / (input.max - input.min);
    input.style.setProperty("--share", share);
  }

  // Whatever takes the operator's hand off the page lets go of the robot, at once.
  #safety() {
    const letGo = () => this.pilot.letGo();
    addEventListener("blur", letGo);
    addEventListener("pagehide", letGo);
    document.addEventListener("visibilitychange", () => document.hidden && letGo());
  }

  #lit() {
    const { $, pilot } = this, held = pilot.holds;
    $("#engage").classList.toggle("on", pilot.engaged);
    $("#engage").setAttribute("aria-pressed", pilot.engaged);
    for (const pedal of $.all(".pedal")) pedal.classList.toggle("on", held.has(pedal.dataset.direction));
    if (pilot.engaged) this.hint("");
  }
}
