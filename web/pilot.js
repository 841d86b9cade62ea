// What this page's operator asks for: the enable, the velocity, the posture. Nothing moves unless something is held.

const TURN = 0.6; // rad/s at the ordinary pace
const BACK = 0.6, SIDE = 0.5; // shares of the pace [m/s]
const FASTEST = { vx: 1.0, back: 0.6, vy: 0.4, yaw_rate: 1.0 };
const TAP_MS = 350; // a shorter press of a latching Engage keeps it pressed
const PATIENCE_MS = 1500; // for the robot to follow a press of Engage

export class Pilot extends EventTarget {
  #held = new Map(); // who holds -> direction
  #posture = {};
  #pressed = 0;
  #followed = false;
  #answer = null;
  engaged = false;
  latch = localStorage.getItem("teleop latch") !== "no";
  pace = Number(localStorage.getItem("teleop pace")) || 0.5; // m/s
  fast = false;

  // Events: "change", something to tell the server now; "refused" {detail: sentence}.

  // ---- the enable

  press() {
    if (this.engaged && this.latch) return this.letGo();
    if (this.engaged) return;
    const { driver, driving } = this.#answer ?? {};
    if (driver && !driving) return this.#refuse(`${driver} is driving; take over first`);
    this.engaged = true;
    this.#followed = false;
    this.#pressed = performance.now();
    this.#posture = {};
    this.#changed();
  }

  release() {
    const tapped = performance.now() - this.#pressed < TAP_MS;
    if (this.engaged && !(this.latch && tapped)) this.letGo();
  }

  // Nothing is held any more: the page is out of sight, a finger was lost, Stop was pressed.
  letGo() {
    const busy = this.engaged || this.#held.size;
    this.engaged = this.fast = false;
    this.#held.clear();
    if (busy) this.#changed();
  }

  setLatch(latch) {
    this.latch = latch;
    localStorage.setItem("teleop latch", latch ? "yes" : "no");
  }

  // ---- the velocity

  // by: the key or pedal; direction: forward, back, left, right, turn-left, turn-right.
  hold(by, direction) {
    if (!this.engaged) return this.#refuse("press Engage first (hold Space)");
    this.#held.set(by, direction);
    this.#changed();
  }

  drop(by) {
    if (this.#held.delete(by)) this.#changed();
  }

  setPace(pace) {
    this.pace = pace;
    localStorage.setItem("teleop pace", pace);
  }

  setFast(fast) {
    this.fast = fast;
    if (this.#held.size) this.#changed();
  }

  get holds() {
    return new Set(this.#held.values());
  }

  get twist() {
    const held = this.holds, pace = this.pace * (this.fast ? 1.8 : 1);
    const axis = (plus, minus) => (held.has(plus) ? 1 : 0) - (held.has(minus) ? 1 : 0);
    const ahead = axis("forward", "back");
    const round = (x) => Math.round(x * 1000) / 1000;
    return {
      vx: round(ahead > 0 ? Math.min(pace, FASTEST.vx) : ahead * Math.min(BACK * pace, FASTEST.back)),
      vy: round(axis("left", "right") * Math.min(SIDE * pace, FASTEST.vy)),
      yaw_rate: round(axis("turn-left", "turn-right") * Math.min((TURN * pace) / 0.5, FASTEST.yaw_rate)),
    };
  }

  // ---- posture: only what was touched since Engage was pressed is sent, so that pressing it moves nothing

  ask(field, value) {
    this.#posture[field] = value;
    this.#changed();
  }

  // ---- the wire

  fields() {
    if (!this.engaged) return { engage: false };
    return { engage: true, twist: this.twist, ...this.#posture };
  }

  hear(answer) {
    this.#answer = answer;
    if (!this.engaged) return;
    if (answer.driving && answer.state === "ENGAGED") {
      this.#followed = true;
    } else if (this.#followed || performance.now() - this.#pressed > PATIENCE_MS) {
      this.letGo(); // somebody pressed Stop or took over, or the robot fell: only a fresh press goes on
    }
  }

  #changed() {
    this.dispatchEvent(new Event("change"));
  }

  #refuse(detail) {
    this.dispatchEvent(new CustomEvent("refused", { detail }));
  }
}
