// How long each stage takes between a hand and the picture: this page's own ones are timed here, the rest comes with the answers.

const SMOOTH = 0.1, TELL_MS = 1000;
export const STAGES = ["device", "network", "queue", "ik", "policy", "physics", "publish", "stream", "picture"];

export class Latency {
  #own = {};
  #input = null; // when the newest event of a hand happened
  #told = 0;

  constructor() {
    const heard = (event) => (this.#input = event.timeStamp);
    for (const type of ["pointerdown", "pointermove", "pointerup", "keydown", "keyup"]) addEventListener(type, heard, { capture: true, passive: true });
  }

  // A pad moved: it has no events.
  moved() {
    this.#input = performance.now();
  }

  // A message goes out that tells of the newest event.
  sends() {
    if (this.#input !== null) this.note("device", performance.now() - this.#input);
    this.#input = null;
  }

  note(stage, ms) {
    const before = this.#own[stage];
    this.#own[stage] = before === undefined ? ms : before + SMOOTH * (ms - before);
  }

  // What the next message says about it.
  fields() {
    const now = performance.now();
    if (now - this.#told < TELL_MS) return {};
    this.#told = now;
    return { timing: Object.fromEntries(Object.entries(this.#own).map(([stage, ms]) => [stage, Math.min(6e4, Math.round(ms * 100) / 100)])) };
  }

  // Of all stages [ms]: this page's own ones, and the server's.
  of(answer) {
    return STAGES.map((stage) => [stage, this.#own[stage] ?? answer.latency_ms[stage] ?? 0]);
  }
}
