// Thumbsticks of a headset's controllers as pedals: the left one walks, the right one turns.

const DEAD = 0.15; // share of a stick's way
const WAYS = [
  [["left", "right"], ["forward", "back"]],
  [["turn-left", "turn-right"], [null, null]],
];

export class Sticks {
  #held = new Set();

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
    if (!pilot.engaged) this.#held.delete(by);
    else if (amount <= 0) this.#held.delete(by) && pilot.drop(by);
    else if (this.#held.has(by)) pilot.adjust(by, amount);
    else {
      this.#held.add(by);
      pilot.hold(by, direction, amount);
    }
  }
}
