// Where the shown qpos comes from: the robot as it is, or a recorded episode.

const AT_ONCE = 2; // requests on their way: one frame travels while the other is drawn
const RETRY_MS = [300, 600, 1200, 2000];

// The robot as it is. The server sends one qpos for each request, so frames never pile up.
export class Live extends EventTarget {
  #socket = null;
  #newest = null;
  #head = null; // {tick, age, arrived} of the newest
  #fresh = false;
  #failures = 0;
  connected = false;
  frames = 0; // shown so far

  // Events: "shown" {detail: {tick, age, waited}}: number of the tick, how old its frame was when it was sent and how long it
  // waited here [ms].
  constructor(url) {
    super();
    this.url = url;
    this.#open();
  }

  // The newest qpos, or null if it was given out already.
  next() {
    if (!this.#fresh) return null;
    this.#fresh = false;
    this.frames += 1;
    this.#ask();
    const { tick, age, arrived } = this.#head;
    this.dispatchEvent(new CustomEvent("shown", { detail: { tick, age, waited: performance.now() - arrived } }));
    return this.#newest;
  }

  // The newest qpos, given out or not.
  get newest() {
    return this.#newest;
  }

  #ask() {
    if (this.#socket.readyState === WebSocket.OPEN) this.#socket.send("next");
  }

  #open() {
    const socket = (this.#socket = new WebSocket(this.url));
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.connected = true;
      this.#failures = 0;
      for (let i = 0; i < AT_ONCE; i++) this.#ask();
    };
    socket.onmessage = ({ data }) => {
      if (this.#fresh) this.#ask(); // the one before was never shown: this one takes its place
      const head = new DataView(data);
      this.#head = { tick: head.getUint32(0, true), age: head.getFloat32(4, true), arrived: performance.now() };
      this.#newest = new Float32Array(data, 8);
      this.#fresh = true;
    };
    socket.onclose = () => {
      this.connected = false;
      this.#fresh = false;
      setTimeout(() => this.#open(), RETRY_MS[Math.min(this.#failures++, RETRY_MS.length - 1)]);
    };
  }
}

// A recorded episode: frames at a fixed rate, shown at any time between its first and its last.
export class Episode {
  #numbers;
  #columns;
  #changed = true;
  #then = null;
  time = 0; // s
  playing = true;

  // numbers: Float32Array of qpos rows; columns: numbers a row; rate: rows a second.
  constructor(numbers, columns, rate) {
    this.#numbers = numbers;
    this.#columns = columns;
    this.rate = rate;
    this.length = numbers.length / columns;
  }

  static async fetch(id) {
    const response = await fetch(`/api/episodes/${id}/frames`);
    if (!response.ok) throw new Error((await response.json()).detail);
    const numbers = new Float32Array(await response.arrayBuffer());
    return new Episode(numbers, Number(response.headers.get("X-Columns")), Number(response.headers.get("X-Rate")));
  }

  get seconds() {
    return Math.max(0, this.length - 1) / this.rate;
  }

  seek(time) {
    this.time = Math.min(Math.max(0, time), this.seconds);
    this.#changed = true;
  }

  // The qpos at this moment [ms, as performance.now()], or null if nothing moved since the last one.
  next(now) {
    const elapsed = this.#then === null ? 0 : (now - this.#then) / 1000;
    this.#then = now;
    if (this.playing) {
      this.seek(this.time + elapsed);
      if (this.time >= this.seconds) this.playing = false;
    }
    if (!this.#changed || !this.length) return null;
    this.#changed = false;
    return this.#at(this.time * this.rate);
  }

  // Between two rows; MuJoCo's qpos may be blended number by number when they are this close, its quaternion is made unit again.
  #at(row) {
    const first = Math.min(Math.floor(row), this.length - 1), second = Math.min(first + 1, this.length - 1);
    const share = row - first, width = this.#columns;
    const a = this.#numbers.subarray(first * width, (first + 1) * width);
    const b = this.#numbers.subarray(second * width, (second + 1) * width);
    const far = Math.hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]) > 0.5; // the robot was put elsewhere between them
    return far ? a : a.map((x, i) => x + share * (b[i] - x));
  }
}
