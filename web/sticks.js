// Thumbsticks of a headset's controllers as pedals: the left one walks, the right one turns.

const DEAD = 0.15; // share of a stick's way
const WAYS = [
  [["left", "right"], ["forward", "back"]],
  [["turn-left", "turn-right"], [null, null]],
];

export class Sticks {
  #held = new Set();
  #early = new Set(); // pushed before Engage was pressed: they have to come back first

  constructor(pilot) {
    this.pilot = pilot;
  }

  // sticks: of this frame, left and right: [x to the right, y to the back] or null.
  read(sticks) {
    sticks.forEach((stick, side) =>
      WAYS[side].forEach((ends, axis) =>
        ends.forEach((direction, end) => {
          if (direction) this.#push(direction, (end ? 1 : -1) * (stick?.[axis] ?? 0));
        }),
      ),
    );
  }

  #push(direction, way) {
    const { pilot } = this, by = `stick ${direction}`, amount = Math.min(1, (way - DEAD) / (1 - DEAD));
    if (amount <= 0) {
      this.#early.delete(by);
      if (this.#held.delete(by)) pilot.drop(by);
    } else if (!pilot.engaged) {
      this.#held.delete(by);
      this.#early.add(by);
    } else if (this.#held.has(by)) pilot.adjust(by, amount);
    else if (!this.#early.has(by)) {
      this.#held.add(by);
      pilot.hold(by, direction, amount);
    }
  }
}
