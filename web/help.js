// The help: which keys do what, and a way to change them.

import { icon } from "./overlay.js";
import { label } from "./keys.js";

const ACTIONS = {
  engage: "Engage: hold, or tap to keep it pressed",
  stop: "Stop at once",
  forward: "Walk forward",
  back: "Walk back",
  left: "Step left",
  right: "Step right",
  "turn-left": "Turn left",
  "turn-right": "Turn right",
  fast: "Faster while held",
  "grip-left": "Close or open the left hand",
  "pinch-left": "Pinch with the left hand, or open it",
  "pinch-right": "Pinch with the right hand, or open it",
  "grip-right": "Close or open the right hand",
  record: "Record, or stop recording",
  success: "Stop recording: it went well",
  failure: "Stop recording: it went wrong",
  discard: "Stop recording and forget it",
  view: "Next view",
};

export class Help {
  constructor($, keys, pads, controls) {
    Object.assign(this, { $, keys, pads, controls });
    $("#help-button").addEventListener("click", () => this.toggle());
  }

  toggle() {
    const { $ } = this;
    $("#help").hidden = !$("#help").hidden;
    $("#help-button").setAttribute("aria-expanded", !$("#help").hidden);
    this.#draw();
  }

  #draw() {
    const { $, keys, pads } = this;
    const rows = Object.entries(ACTIONS).map(([action, what]) => {
      const names = [...keys.of(action).map(label), ...pads.of(action)];
      const caps = names.map((name) => `<kbd>${name}</kbd>`).join(" ");
      return `<tr><th>${what}</th><td><button class="small" data-learn="${action}" title="Add another key">${caps || "none"}</button></td></tr>`;
    });
    $("#help").innerHTML = `
      <header><strong>How to drive</strong><button class="icon" aria-label="Close">${icon("close")}</button></header>
      <ol><li><b>Engage.</b> The robot listens only while it is pressed.</li><li><b>Hold</b> a key or a pedal to walk; let go to stand.</li>
      <li><b>Drag</b> the arrows at a wrist to move the hand, its arcs to turn it.</li></ol>
      <table>${rows.join("")}</table>
      <footer><span>Press a key's name, then the key, foot pedal or stick that shall do the same.${
        pads.names.length ? ` Plugged in: ${pads.names.join(", ")}.` : " A gamepad shows up once a button of it is pressed."
      }</span>
      <button class="small" data-forget>Default keys</button></footer>`;
    $("#help header button").addEventListener("click", () => this.toggle());
    $("#help [data-forget]").addEventListener("click", () => this.#changed(keys.forget(), pads.forget()));
    for (const button of $.all("[data-learn]")) {
      button.addEventListener("click", async () => {
        button.textContent = "press it";
        await Promise.race([keys.learn(button.dataset.learn), pads.learn(button.dataset.learn)]);
        keys.ignore();
        pads.ignore();
        this.#changed();
      });
    }
  }

  #changed() {
    this.#draw();
    this.controls.keycaps();
  }
}
