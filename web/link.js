// The operator's socket: 20 messages a second, each also the sign of life. See OperatorMessage and Answer at /docs.

const HEARTBEAT_MS = 50; // by timer: animation frames stop in hidden pages
const SILENT_MS = 1500; // a server that says nothing for this long is lost
const RETRY_MS = [200, 400, 800, 1600, 2500];
const VERSION = 1; // of the wire, app/protocol.py

export class Link extends EventTarget {
  #socket = null;
  #timer = 0;
  #failures = 0;
  #sent = new Map(); // seq -> when
  #heard = 0;
  seq = 0; // of the next message
  connected = false;
  id = ""; // of this client

  // fields: called for each message with its number, returns what else it says.
  // Events: "answer" {detail: Answer}, "timed" {detail: ms that a message takes, one way}, "open", "close".
  constructor(url, fields) {
    super();
    Object.assign(this, { url, fields });
    this.#open();
  }

  // Say now what has changed, and go on every 50 ms.
  send() {
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.send(), HEARTBEAT_MS);
    if (!this.connected) return;
    if (performance.now() - this.#heard > SILENT_MS) {
      this.#socket.close();
      this.#lose();
      return;
    }
    this.#sent.set(this.seq, performance.now());
    const seq = this.seq++;
    this.#socket.send(JSON.stringify({ seq, ...this.fields(seq) }));
  }

  // Send a headset's packet, numbered like a message. Returns false, and sends nothing, while an earlier one waits to leave.
  sendPacket(numbered) {
    if (!this.connected || this.#socket.bufferedAmount) return false;
    this.#socket.send(numbered(this.seq++));
    return true;
  }

  #open() {
    const socket = (this.#socket = new WebSocket(this.url));
    socket.onopen = () => {
      this.connected = true;
      this.#heard = performance.now();
      this.#failures = 0;
      this.#sent.clear();
      this.dispatchEvent(new Event("open"));
      this.send();
    };
    socket.onmessage = ({ data }) => this.#hear(JSON.parse(data));
    socket.onclose = () => socket === this.#socket && this.#lose();
  }

  #lose() {
    const wasConnected = this.connected;
    this.connected = false;
    this.#socket = null;
    clearTimeout(this.#timer);
    setTimeout(() => this.#open(), RETRY_MS[Math.min(this.#failures++, RETRY_MS.length - 1)]);
    if (wasConnected) this.dispatchEvent(new Event("close"));
  }

  #hear(answer) {
    if (answer.version === VERSION) sessionStorage.removeItem("reloaded");
    else if (!sessionStorage.getItem("reloaded")) {
      sessionStorage.setItem("reloaded", "yes");
      location.reload(); // the program was updated under this page
    }
    this.id = answer.id;
    const now = (this.#heard = performance.now());
    const sent = this.#sent.get(answer.seq);
    if (sent !== undefined) {
      this.dispatchEvent(new CustomEvent("timed", { detail: Math.max(0, now - sent - answer.waited) / 2 }));
      for (const seq of this.#sent.keys()) if (seq <= answer.seq) this.#sent.delete(seq);
    }
    this.dispatchEvent(new CustomEvent("answer", { detail: answer }));
  }
}
