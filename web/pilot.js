// What this page's operator asks for: the enable, the velocity, the posture. Nobody walks unless something is held.

const BACK = 0.6; // share of the pace [m/s]
const FASTER = 1.8; // while "fast" is held
const TAP_MS = 350; // a shorter press of a latching Engage keeps it pressed
const PATIENCE_MS = 1500; // for the robot to follow a press of Engage

const DIRECTIONS = new Set(["forward", "back", "left", "right", "turn-left", "turn-right"]);

const stored = (name, otherwise) => Number(localStorage.getItem(`teleop ${name}`)) || otherwise;

export class Pilot extends EventTarget {
  #held = new Map(); // who holds -> {direction, amount}
  #posture = {};
  #pressed = 0;
  #followed = false;
  engaged = false;
  latch = localStorage.getItem("teleop latch") !== "no";
  limits = { pace: stored("pace", 0.5), side: stored("side", 0.25), turn: stored("turn", 0.6) }; // m/s, m/s, rad/s
  fast = false;

  // Events: "change", something to tell the server now; "refused" {detail: sentence}.

  // trained: what the legs were trained for, from GET /api/scene.
  constructor(roles, { vx, vy, yaw_rate }) {
    super();
    this.roles = roles;
    this.fastest = { pace: vx[1], back: -vx[0], side: vy[1], turn: yaw_rate[1] };
  }

  // Do what a device (keys.js, pads.js) says; actions: what else a key may do, a function each.
  listen(device, actions) {
    device.addEventListener("down", ({ detail: { action, code, amount } }) => {
      if (DIRECTIONS.has(action)) this.hold(code, action, amount);
      else if (action === "engage") this.press();
      else if (action === "fast") this.setFast(true);
      else actions[action]?.();
    });
    device.addEventListener("move", ({ detail: { code, amount } }) => this.adjust(code, amount));
    device.addEventListener("up", ({ detail: { action, code } }) => {
      if (DIRECTIONS.has(action)) this.drop(code);
      else if (action === "engage") this.release();
      else if (action === "fast") this.setFast(false);
    });
    device.addEventListener("gone", () => this.letGo());
  }

  // ---- the enable

  press() {
    if (this.engaged && this.latch) return this.letGo();
    if (this.engaged) return;
    const { roles } = this;
    if (!roles.wanted.some((role) => roles.may(role))) {
      const driver = roles.wanted.map((role) => roles.other(role)).find(Boolean);
      return this.#refuse(driver ? `${driver} is driving; take over first` : "this page only watches; choose a role first");
    }
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

  // by: the key or pedal; direction: forward, back, left, right, turn-left, turn-right; amount: how far it is pressed, 0 to 1.
  hold(by, direction, amount = 1) {
    if (!this.engaged) return this.#refuse("press Engage first (hold Space)");
    if (!this.roles.may("legs")) return this.#refuse(`${this.roles.other("legs") ?? "nobody"} drives the legs`);
    this.#held.set(by, { direction, amount });
    this.#changed();
  }

  // A stick or pedal that is held moved on. One that was held before Engage was pressed has to come back first.
  adjust(by, amount) {
    if (!this.#held.has(by)) return;
    this.#held.get(by).amount = amount;
    this.#changed();
  }

  drop(by) {
    if (this.#held.delete(by)) this.#changed();
  }

  // name: pace, side or turn.
  setLimit(name, value) {
    this.limits[name] = value;
    localStorage.setItem(`teleop ${name}`, value);
    if (this.#held.size) this.#changed();
  }

  setFast(fast) {
    this.fast = fast;
    if (this.#held.size) this.#changed();
  }

  get holds() {
    return new Set([...this.#held.values()].map(({ direction }) => direction));
  }

  get twist() {
    const limit = (name) => Math.min(this.limits[name] * (this.fast ? FASTER : 1), this.fastest[name]);
    const most = (wanted) => Math.max(0, ...[...this.#held.values()].map(({ direction, amount }) => (direction === wanted ? amount : 0)));
    const ahead = most("forward") - most("back");
    const round = (x) => Math.round(x * 1000) / 1000;
    return {
      vx: round(ahead * (ahead > 0 ? limit("pace") : Math.min(BACK * limit("pace"), this.fastest.back))),
      vy: round((most("left") - most("right")) * limit("side")),
      yaw_rate: round((most("turn-left") - most("turn-right")) * limit("turn")),
    };
  }

  // ---- posture: only what was touched since Engage was pressed is sent, so that pressing it moves nothing

  ask(field, value) {
    if (!this.engaged) return this.#refuse("press Engage first (hold Space)");
    this.#posture[field] = value;
    this.#changed();
  }

  // ---- the wire

  fields() {
    if (!this.engaged) return { engage: false };
    return { engage: true, twist: this.twist, ...this.#posture };
  }

  hear(answer) {
    if (!this.engaged) return;
    if (answer.driving && this.roles.own.state === "ENGAGED") {
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
