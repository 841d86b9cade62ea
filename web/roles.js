// Who drives what, from this page's side: what it would drive, what it does drive, and what it says about that.

export const ROLES = ["arms", "legs"];

export class Roles extends EventTarget {
  #answer = null;
  #asks = false;
  #once = {}; // what only the next message says
  #settled = 0; // answers to earlier messages know nothing of the newest wish
  wanted = ROLES;
  name = localStorage.getItem("teleop name") ?? "";

  // Events: "change", something to tell the server now.

  // role: from the page's address; "arms" or "legs", anything else is both.
  constructor(role) {
    super();
    if (ROLES.includes(role)) this.wanted = [role];
  }

  // ---- what a person wishes

  take(...roles) {
    this.#wish([...this.drives, ...roles], false, { take: true });
  }

  ask(...roles) {
    this.#wish([...this.drives, ...roles], true);
  }

  release(...roles) {
    this.#wish(this.wanted.filter((role) => !roles.includes(role)), false);
  }

  // Hand what a member of the crew asks for to them.
  give({ id, asks }) {
    this.#wish(this.wanted.filter((role) => !asks.includes(role)), false, { give: id });
  }

  setName(name) {
    this.name = name.trim().slice(0, 40);
    localStorage.setItem("teleop name", this.name);
    this.dispatchEvent(new Event("change"));
  }

  // ---- what is

  get asking() {
    return this.#asks;
  }

  get drives() {
    return this.#answer?.drives ?? [];
  }

  // The name of another one who drives a role, or null.
  other(role) {
    return this.drives.includes(role) ? null : (this.#answer?.roles[role].driver ?? null);
  }

  // Whether a press of Engage here makes the role follow.
  may(role) {
    return this.drives.includes(role) || (this.wanted.includes(role) && !this.other(role));
  }

  // {state, reason} of what this page drives; of the whole robot where it drives nothing.
  get own() {
    const mine = this.drives.map((role) => this.#answer.roles[role]);
    return mine.find(({ state }) => state !== "ENGAGED") ?? mine[0] ?? this.#answer;
  }

  // ---- the wire

  fields(seq) {
    if (this.#settled === Infinity) this.#settled = seq;
    const once = this.#once;
    this.#once = {};
    return { roles: this.wanted, ...(this.name ? { name: this.name } : {}), ...(this.#asks ? { ask: true } : {}), ...once };
  }

  hear(answer) {
    this.#answer = answer;
    if (answer.seq < this.#settled) return;
    if (this.wanted.every((role) => answer.drives.includes(role))) this.#asks = false;
    // Whoever shares the robot is content with a part of it, and does not get the rest by surprise when the other one leaves.
    if (answer.drives.length && !this.#asks && this.wanted.some((role) => this.other(role))) this.wanted = answer.drives;
  }

  #wish(wanted, asks, once = {}) {
    this.wanted = ROLES.filter((role) => wanted.includes(role));
    this.#asks = asks;
    this.#once = once;
    this.#settled = Infinity;
    this.dispatchEvent(new Event("change"));
  }
}
