// A board of buttons within reach of a person in a headset, pressed with a fingertip, a pinch or a controller's ray.

import { apply, fromPose, inverse } from "./matrix.js";
import { about, multiply, rotate } from "./rotation.js";

const WIDTH = 0.36, HEIGHT = 0.2; // m
const PIXELS = 1600; // a metre
const TOUCHED = 0.012, APART = 0.035; // distances of a fingertip from the board [m]
const STATES = { STOPPED: "#7d8798", HOLD: "#e7ab48", ENGAGED: "#2fc496", FAULT: "#f0555c", LOST: "#f0555c" };

export class Board {
  #place = null; // matrix from the board into WebXR's space
  #armed = [true, true];
  #pressed = [false, false]; // rays
  #shown = "";
  size = [WIDTH, HEIGHT];
  canvas = Object.assign(document.createElement("canvas"), { width: WIDTH * PIXELS, height: HEIGHT * PIXELS });

  // buttons: [{label: () => text, colour: () => css or undefined, press: () => void}, ...], two rows of them.
  constructor(buttons) {
    this.buttons = buttons;
  }

  get place() {
    return this.#place;
  }

  // Put it before the person, low and a little to the left, where it hides little. head: {position, orientation}.
  recentre({ position, orientation: { x, y, z, w } }) {
    const [ax, , az] = rotate([w, x, y, z], [0, 0, -1]), yaw = Math.atan2(-ax, -az);
    const face = about([0, 1, 0], yaw), [dx, dy, dz] = rotate(face, [-0.16, -0.48, -0.42]);
    const turn = multiply(multiply(face, about([0, 1, 0], 0.35)), about([1, 0, 0], -0.9));
    this.#place = fromPose([position.x + dx, position.y + dy, position.z + dz], turn);
  }

  // tips: fingertips, left and right, in WebXR's space, or null.
  touch(tips) {
    tips.forEach((tip, side) => {
      if (!tip || !this.#place) return;
      const [x, y, z] = apply(inverse(this.#place), tip), button = this.#at(x, y);
      if (z > APART || !button) this.#armed[side] = z > APART || this.#armed[side];
      else if (z < TOUCHED && z > -APART && this.#armed[side]) {
        this.#armed[side] = false;
        button.press();
      }
    });
  }

  // A ray from a point through another one, and whether its side presses now.
  point(side, from, through, presses) {
    const begins = presses && !this.#pressed[side];
    this.#pressed[side] = presses;
    if (!begins || !this.#place) return;
    const back = inverse(this.#place), a = apply(back, from), b = apply(back, through);
    const share = a[2] / (a[2] - b[2]);
    if (share > 0) this.#at(a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]))?.press();
  }

  // Paint what has changed. Returns whether anything has.
  paint(state, line) {
    const labels = this.buttons.map(({ label, colour }) => [label(), colour?.() ?? ""]);
    const shown = JSON.stringify([state, line, labels]);
    if (shown === this.#shown) return false;
    this.#shown = shown;
    const { canvas } = this, pen = canvas.getContext("2d");
    pen.fillStyle = "#1b212b";
    pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.fillStyle = STATES[state] ?? STATES.STOPPED;
    pen.fillRect(0, 0, canvas.width, 10);
    pen.textBaseline = "middle";
    pen.font = "600 26px system-ui, sans-serif";
    pen.fillText(state, 18, 40);
    const rest = 34 + pen.measureText(state).width;
    pen.fillStyle = "#c3cbd8";
    pen.font = "20px system-ui, sans-serif";
    pen.fillText(line, rest, 41, canvas.width - rest - 18);
    this.buttons.forEach((_, i) => {
      const { x, y, width, height } = this.#cell(i);
      const [label, colour] = labels[i];
      pen.fillStyle = colour || "#343d4c";
      pen.beginPath();
      pen.roundRect(x, y, width, height, 14);
      pen.fill();
      pen.fillStyle = "#fff";
      pen.font = "600 25px system-ui, sans-serif";
      pen.textAlign = "center";
      pen.fillText(label, x + width / 2, y + height / 2, width - 12);
      pen.textAlign = "left";
    });
    return true;
  }

  // Of the i-th button, in pixels of the canvas.
  #cell(i) {
    const { width, height } = this.canvas, columns = Math.ceil(this.buttons.length / 2), gap = 12, top = 68;
    const w = (width - gap * (columns + 1)) / columns, h = (height - top - 2 * gap) / 2;
    return { x: gap + (i % columns) * (w + gap), y: top + Math.floor(i / columns) * (h + gap), width: w, height: h };
  }

  #at(x, y) {
    const px = (x + WIDTH / 2) * PIXELS, py = (HEIGHT / 2 - y) * PIXELS;
    return this.buttons.find((_, i) => {
      const cell = this.#cell(i);
      return px > cell.x && px < cell.x + cell.width && py > cell.y && py < cell.y + cell.height;
    });
  }
}
