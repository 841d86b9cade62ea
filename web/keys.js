// The keyboard. It is heard before viser hears it, which would fly its camera with the same keys.

const DEFAULTS = {
  Space: "engage", Escape: "stop",
  KeyW: "forward", KeyS: "back", KeyA: "left", KeyD: "right", KeyQ: "turn-left", KeyE: "turn-right",
  ArrowUp: "forward", ArrowDown: "back", ArrowLeft: "turn-left", ArrowRight: "turn-right",
  ShiftLeft: "fast", KeyR: "record", KeyF: "view", KeyY: "success", KeyN: "failure", Backspace: "discard",
  KeyZ: "grip-left", KeyX: "pinch-left", KeyC: "pinch-right", KeyV: "grip-right",
};
const STORED = "teleop keys";

// Key (KeyboardEvent.code) -> action. Foot pedals that enumerate as keyboards get their own.
export class Keys extends EventTarget {
  #map = { ...DEFAULTS, ...JSON.parse(localStorage.getItem(STORED) ?? "{}") };
  #listening = null; // resolves with the next key
  #down = new Set();
  #tabbed = false; // the focus was moved by the keyboard (:focus-visible holds for a clicked button, too, once any key is pressed)

  // Events: "down" and "up" {detail: {action, code}}.
  constructor() {
    super();
    addEventListener("keydown", (event) => this.#keydown(event), { capture: true });
    addEventListener("keyup", (event) => this.#keyup(event), { capture: true });
    addEventListener("blur", () => this.#down.clear());
    addEventListener("pointerdown", () => (this.#tabbed = false), { capture: true });
  }

  // Codes of an action's keys.
  of(action) {
    return Object.keys(this.#map).filter((code) => this.#map[code] === action);
  }

  // Give the next pressed key to an action (Escape: leave it as it is); resolves when one was pressed.
  async learn(action) {
    const code = await new Promise((resolve) => (this.#listening = resolve));
    if (!code) return;
    const own = { ...JSON.parse(localStorage.getItem(STORED) ?? "{}"), [code]: action };
    localStorage.setItem(STORED, JSON.stringify(own));
    this.#map[code] = action;
  }

  ignore() {
    this.#listening = null;
  }

  forget() {
    localStorage.removeItem(STORED);
    this.#map = { ...DEFAULTS };
  }

  #keydown(event) {
    if (this.#listening) {
      this.#take(event);
      this.#listening(event.code === "Escape" ? null : event.code);
      this.#listening = null;
      return;
    }
    if (event.code === "Tab") this.#tabbed = true;
    const action = this.#map[event.code];
    if (!action || event.ctrlKey || event.metaKey || event.altKey || writes(event) || (this.#tabbed && presses(event))) return;
    this.#take(event);
    if (event.repeat || this.#down.has(event.code)) return;
    this.#down.add(event.code);
    this.#tell("down", action, event.code);
  }

  // Letting go always counts, whatever else is held or focused by now.
  #keyup(event) {
    if (!this.#down.delete(event.code)) return;
    this.#take(event);
    this.#tell("up", this.#map[event.code], event.code);
  }

  #take(event) {
    event.preventDefault();
    event.stopImmediatePropagation();
  }

  #tell(type, action, code) {
    this.dispatchEvent(new CustomEvent(type, { detail: { action, code } }));
  }
}

// Whether the key is meant for a field that has the focus (inside our shadow root, too).
function writes(event) {
  const target = event.composedPath()[0];
  if (target.type === "range") return event.code.startsWith("Arrow");
  return target.isContentEditable || (/^(INPUT|TEXTAREA|SELECT)$/.test(target.tagName) && target.type !== "checkbox");
}

// Whether the key presses what has the focus. On Engage it may still be held, as anywhere.
function presses(event) {
  return /^(Space|Enter)$/.test(event.code) && event.composedPath()[0].matches("button:not(#engage), a, summary, input");
}

// What is printed on a key.
export function label(code) {
  const names = { Space: "Space", Escape: "Esc", ArrowUp: "↑", ArrowDown: "↓", ArrowLeft: "←", ArrowRight: "→", ShiftLeft: "Shift", Backspace: "⌫" };
  return names[code] ?? code.replace(/^(Key|Digit)/, "");
}
