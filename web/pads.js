// Gamepads, and foot pedals that enumerate as one. They are asked again and again: the Gamepad API has no events for buttons.

const STANDARD = {
  "axis 1-": "forward", "axis 1+": "back", "axis 0-": "left", "axis 0+": "right", "axis 2-": "turn-left", "axis 2+": "turn-right",
  "button 12": "forward", "button 13": "back", "button 14": "turn-left", "button 15": "turn-right",
  "button 0": "engage", "button 1": "stop", "button 5": "fast", "button 3": "view", "button 8": "record",
}; // of pads whose mapping is "standard"
const STORED = "teleop pads", DEAD_ZONE = "teleop dead zone", CURVE = "teleop curve";
const POLL_MS = 10, SEARCH_MS = 300; // with a pad, without one
const LEARNT = 0.6; // of its way, and an input is the one that is meant

// Input of a pad -> action. Inputs: "button 3", "axis 1-" (from the middle down), "axis 2 from 1" (a pedal that rests at an end).
export class Pads extends EventTarget {
  #own = JSON.parse(localStorage.getItem(STORED) ?? "{}"); // a pad's id -> input -> action
  #amounts = new Map(); // code -> {action, amount, pad}
  #pads = new Map(); // index -> Gamepad
  #listening = null;
  deadZone = Number(localStorage.getItem(DEAD_ZONE) ?? 0.12); // of a stick's way
  curve = Number(localStorage.getItem(CURVE) ?? 1.6); // 1: straight; more: finer near the middle

  // Events: "down", "move" and "up" {detail: {action, code, amount}}, amount in (0, 1]; "gone", a pad that was in use is unplugged.
  constructor() {
    super();
    addEventListener("gamepadconnected", () => this.#poll());
    addEventListener("gamepaddisconnected", () => this.#poll());
    this.#again();
  }

  // Names of the pads that are plugged in.
  get names() {
    return [...this.#pads.values()].map(({ id }) => id.replace(/ *\(.*/, ""));
  }

  // Inputs of an action, of the pads that are plugged in.
  of(action) {
    const inputs = [...this.#pads.values()].flatMap((pad) => Object.entries(this.#map(pad)));
    return inputs.filter(([, does]) => does === action).map(([input]) => input);
  }

  set(name, value) {
    this[name] = value;
    localStorage.setItem({ deadZone: DEAD_ZONE, curve: CURVE }[name], value);
  }

  // Give the next input that moves to an action; resolves then.
  async learn(action) {
    const rest = new Map([...this.#pads.values()].map((pad) => [pad.index, [...pad.axes]]));
    const { pad, input } = await new Promise((resolve) => (this.#listening = { resolve, rest }));
    const own = (this.#own[pad.id] ??= {});
    own[input] = action;
    localStorage.setItem(STORED, JSON.stringify(this.#own));
  }

  ignore() {
    this.#listening = null;
  }

  forget() {
    localStorage.removeItem(STORED);
    this.#own = {};
  }

  #map(pad) {
    return { ...(pad.mapping === "standard" ? STANDARD : {}), ...this.#own[pad.id] };
  }

  #again() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.#poll(), this.#pads.size ? POLL_MS : SEARCH_MS);
  }

  #poll() {
    const plugged = [...(navigator.getGamepads?.() ?? [])].filter((pad) => pad?.connected);
    const before = this.#pads;
    this.#pads = new Map(plugged.map((pad) => [pad.index, pad]));
    for (const index of before.keys()) if (!this.#pads.has(index)) this.#gone(index);
    if (this.#listening) this.#hear(plugged);
    else for (const pad of plugged) this.#read(pad);
    this.#again();
  }

  #read(pad) {
    const awake = document.hasFocus() && !document.hidden; // a pad drives the page that is looked at
    for (const [input, action] of Object.entries(this.#map(pad))) {
      const code = `pad ${pad.index} ${input}`, held = this.#amounts.get(code);
      const amount = awake ? this.#amount(pad, input) : 0;
      if (amount === (held?.amount ?? 0)) continue;
      if (amount) this.#amounts.set(code, { action, amount, pad: pad.index });
      else this.#amounts.delete(code);
      this.#tell(!held ? "down" : amount ? "move" : "up", { action: held?.action ?? action, code, amount });
    }
  }

  // How far an input is pressed, 0 to 1.
  #amount(pad, input) {
    const way = travel(pad, input);
    if (input.startsWith("button")) return way > 0.05 ? way : 0;
    return Math.max(0, (way - this.deadZone) / (1 - this.deadZone)) ** this.curve;
  }

  #gone(index) {
    const held = [...this.#amounts].filter(([, { pad }]) => pad === index);
    for (const [code, { action }] of held) {
      this.#amounts.delete(code);
      this.#tell("up", { action, code, amount: 0 });
    }
    this.#tell("gone", { pad: index });
  }

  #hear(plugged) {
    const { resolve, rest } = this.#listening;
    for (const pad of plugged) {
      const inputs = [...pad.buttons.keys()].map((i) => `button ${i}`);
      pad.axes.forEach((_, i) => {
        const from = Math.round(rest.get(pad.index)?.[i] ?? 0);
        inputs.push(...(from ? [`axis ${i} from ${from}`] : [`axis ${i}-`, `axis ${i}+`]));
      });
      const input = inputs.find((name) => travel(pad, name) > LEARNT);
      if (!input) continue;
      this.#listening = null;
      return resolve({ pad, input });
    }
  }

  #tell(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}

// How far an input is from where it rests, 0 to 1.
function travel(pad, input) {
  const [, kind, number, sign, from] = /^(button|axis) (\d+)([-+]?)(?: from (-?1))?$/.exec(input) ?? [];
  if (kind === "button") return pad.buttons[number]?.value || Number(pad.buttons[number]?.pressed ?? 0);
  const value = pad.axes[number] ?? Number(from ?? 0);
  const way = from ? Math.abs(value - from) / 2 : sign === "-" ? -value : value;
  return Math.min(1, Math.max(0, way));
}
