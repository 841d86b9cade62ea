// What the motion prior expects the arms to do: beads where the wrists will be in the next second, and the hands half a second ahead.

import { ask } from "./ask.js";
import { text } from "./status.js";

const PERIOD_MS = 100;
const KEPT = "teleop forecast";
const UPRIGHT = [1, 0, 0, 0];
const STILL = 0.003; // wrists that move less in half a second stand [m]

export class Forecast {
  #visible = false;

  // stage: moves the picture, whose description names the beads and the hands.
  constructor($, stage) {
    Object.assign(this, { viewer: stage.viewer, stage, box: $("#forecast"), told: $("#expected") });
    this.box.checked = localStorage.getItem(KEPT) === "yes";
    this.box.addEventListener("change", () => localStorage.setItem(KEPT, this.box.checked ? "yes" : "no"));
    this.viewer.addEventListener("scene", () => (this.#visible = false));
    this.#follow();
  }

  async #follow() {
    let answer = null;
    if (this.box.checked && !document.hidden && !this.stage.playback) answer = await ask("/api/forecast").catch(() => null);
    this.#show(answer);
    setTimeout(() => this.#follow(), PERIOD_MS);
  }

  #show(forecast) {
    const { wrists } = this.stage.description, { viewer } = this, visible = Boolean(forecast?.prior);
    text(this.told, forecast ? sentence(forecast) : "");
    if (visible !== this.#visible) wrists.forEach(({ ahead, expected }) => [...ahead, expected].forEach((name) => viewer.visible(name, visible)));
    this.#visible = visible;
    if (!visible) return;
    [forecast.left, forecast.right].forEach(({ path, pose }, side) => {
      wrists[side].ahead.forEach((bead, i) => viewer.pose(bead, path[i + 1], UPRIGHT));
      viewer.pose(wrists[side].expected, pose.position, pose.quaternion);
    });
  }
}

function sentence({ policy, prior, error, still }) {
  if (!prior) return `${policy} has no motion prior.`;
  if (error === null) return "Half a second ahead: not known yet.";
  if (still < STILL) return "Half a second ahead: the wrists stay.";
  return `Half a second ahead: ${millimetres(error)} off; ${millimetres(still)} had it said that they stay.`;
}

const millimetres = (value) => `${(1000 * value).toFixed(0)} mm`;
