// Recording: the episode that is open, how it ends, and the list of those before.

import { ask } from "./ask.js";
import { icon } from "./overlay.js";
import { Playback, clock, name, when } from "./playback.js";
import { text } from "./status.js";

const SURE_MS = 3000; // for the second press of a button that forgets an episode
const FRESH = "teleop fresh start", SEED = "teleop next seed";
const MARKS = { true: ["✓", "it went well"], false: ["✗", "it went wrong"], null: ["·", "not marked"] };
const NEXT = { true: false, false: null, null: true };

export class Episodes {
  #recording = null; // id of the open episode
  #since = 0;
  #refreshes = 0;
  #list = [];

  // reset: puts the robot back, with a seed; resolves to whether it did.
  constructor($, stage, controls, reset) {
    Object.assign(this, { $, controls, reset });
    this.playback = new Playback($, stage, controls);
    $("#record").addEventListener("click", () => this.toggle());
    $("#success").addEventListener("click", () => this.end(true));
    $("#failure").addEventListener("click", () => this.end(false));
    $("#discard").addEventListener("click", () => this.discard());
    $("#fresh").checked = localStorage.getItem(FRESH) === "yes";
    $("#fresh").addEventListener("change", ({ target }) => localStorage.setItem(FRESH, target.checked ? "yes" : "no"));
    setInterval(() => this.#clock(), 100);
    this.refresh();
  }

  // Start recording, or stop.
  async toggle() {
    if (this.#recording) return this.end(null);
    this.#ask("POST", "", { label: this.#task });
  }

  // Stop recording; success: true, false, or null for unmarked.
  async end(success) {
    if (this.#recording && (await this.#ask("POST", `/${this.#recording}/stop`, { label: this.#task, success }))) this.#afresh();
  }

  async discard() {
    if (!this.#recording || !this.#sure(this.$("#discard"), "discard this recording")) return;
    if (await this.#ask("POST", `/${this.#recording}/discard`)) this.#afresh();
  }

  show(answer) {
    const { $ } = this;
    $("#alarm").hidden = !answer.recording_alarm;
    if (answer.recording_alarm) text($("#alarm span"), answer.recording_alarm);
    if (answer.recording === this.#recording) return;
    this.#recording = answer.recording;
    this.#since = performance.now();
    $.host.toggleAttribute("data-recording", Boolean(this.#recording));
    $("#endings").hidden = !this.#recording;
    $("#discard").removeAttribute("data-sure");
    this.refresh();
  }

  async refresh() {
    const refresh = ++this.#refreshes, all = await ask("/api/episodes").catch(() => null);
    if (!all || refresh !== this.#refreshes) return; // without a connection, which the page shows; or a later one tells more
    this.#list = all.filter((episode) => episode.ended !== "open");
    const { $ } = this, count = (success) => this.#list.filter((episode) => episode.success === success).length;
    const seconds = this.#list.reduce((sum, episode) => sum + episode.seconds, 0);
    $("#no-episodes").hidden = this.#list.length > 0;
    text($("#counters"), this.#list.length ? `${this.#list.length} · ${clock(seconds)} · ✓ ${count(true)} · ✗ ${count(false)}` : "");
    $("#episodes").replaceChildren(...this.#list.map((episode) => this.#item(episode)));
    this.playback.list(this.#list);
  }

  get #task() {
    return this.$("#label").value.trim();
  }

  // Between two episodes: another start, always a new one and always known.
  async #afresh() {
    if (!this.$("#fresh").checked) return;
    const seed = Number(localStorage.getItem(SEED) ?? 1);
    if (await this.reset(seed)) localStorage.setItem(SEED, (seed % 1e6) + 1);
  }

  #item(episode) {
    const item = document.createElement("li");
    item.innerHTML = `<button class="icon" title="Play back">${icon("play")}</button><span><b></b><small></small></span><button class="icon mark"></button>
      <a class="icon" title="Download" download>${icon("download")}</a><button class="icon" title="Delete">${icon("trash")}</button>`;
    const [play, mark, remove] = item.querySelectorAll("button"), link = item.querySelector("a");
    item.querySelector("b").textContent = name(episode);
    const notes = [clock(episode.seconds), episode.ended === "truncated" && "cut off"];
    notes.push(episode.missing && `${episode.missing} ticks missing`, episode.label && when(episode.start));
    item.querySelector("small").textContent = notes.filter(Boolean).join(" · ");
    [mark.textContent, mark.title] = MARKS[episode.success];
    mark.addEventListener("click", () => this.#ask("POST", `/${episode.id}/label`, { success: NEXT[episode.success] }));
    link.href = `/api/episodes/${episode.id}/download`;
    play.addEventListener("click", () => this.playback.show(episode));
    remove.addEventListener("click", () => this.#sure(remove, "delete this episode") && this.#ask("DELETE", `/${episode.id}`));
    return item;
  }

  // Whether a button is pressed for the second time; the first time asks, in its place and in the hint.
  #sure(button, what) {
    if (!button.toggleAttribute("data-sure")) return true;
    this.controls.hint(`press again to ${what}`, true);
    setTimeout(() => button.removeAttribute("data-sure"), SURE_MS);
    return false;
  }

  // Resolves to whether it was done; else the page says why not.
  async #ask(method, path, body) {
    try {
      await ask(`/api/episodes${path}`, method, body);
      this.refresh();
      return true;
    } catch ({ message }) {
      this.controls.hint(message, true);
      return false;
    }
  }

  #clock() {
    text(this.$("#record span"), this.#recording ? clock((performance.now() - this.#since) / 1000) : "Record");
  }
}
