// A headset's packet, laid out as the server says (GET /api/headset, app/protocol.py).

const WRITE = { u1: ["setUint8", 1], u4: ["setUint32", 4], f4: ["setFloat32", 4], f8: ["setFloat64", 8] };

export class Packet {
  #view;
  #fields;

  // layout: from GET /api/headset.
  constructor(layout) {
    this.seen = layout.valid; // bits of the field valid, by name
    this.asks = layout.asks; // bits of the field asks, by name
    this.version = layout.version;
    this.#view = new DataView(new ArrayBuffer(layout.size));
    this.#fields = Object.fromEntries(layout.fields.map((field) => [field.name, field]));
  }

  // Nothing of the frame before stays.
  clear() {
    new Uint8Array(this.#view.buffer).fill(0);
    this.set("version", [this.version]);
  }

  // Numbers of a field, from its at-th on.
  set(name, values, at = 0) {
    const { type, offset } = this.#fields[name], [write, width] = WRITE[type];
    for (let i = 0; i < values.length; i++) this.#view[write](offset + width * (at + i), values[i], true);
  }

  get bytes() {
    return this.#view.buffer;
  }
}
