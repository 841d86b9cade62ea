// Recording, the list of episodes, and playback.

import { icon } from "./overlay.js";
import { Episode } from "./sources.js";
import { text } from "./status.js";

const SURE_MS = 3000; // for the second press of a delete button

export class Episodes {
  #recording = null; // id of the open episode
  #since = 0;
  #list = [];

  constructor($, stage, controls) {
    Object.assign(this, { $, stage, controls });
    $("#record").addEventListener("click", () => this.toggle());
    $("#discard").addEventListener("click", () => this.#ask("POST", `/${this.#recording}/discard`));
    $("#playback-close").addEventListener("click", () => stage.play(null));
    $("#playback-toggle").addEventListener("click", () => this.#pause());
    $("#playback-time").addEventListener("input", ({ target }) => {
      stage.playback.playing = false;
      stage.playback.seek(Number(target.value));
    });
    stage.addEventListener("playback", () => ($("#playback").hidden = !stage.playback));
    setInterval(() => this.#clock(), 100);
    this.refresh();
  }

  // Start recording, or stop.
  toggle() {
    const label = this.$("#label").value.trim();
    return this.#recording ? this.#ask("POST", `/${this.#recording}/stop`, { label }) : this.#ask("POST", "", { label });
  }

  show(answer) {
    if (answer.recording === this.#recording) return;
    const { $ } = this;
    this.#recording = answer.recording;
    this.#since = performance.now();
    $.host.toggleAttribute("data-recording", Boolean(this.#recording));
    $("#discard").hidden = !this.#recording;
    if (!this.#recording) $("#label").value = "";
    this.refresh();
  }

  async refresh() {
    const response = await fetch("/api/episodes").catch(() => null);
    if (!response?.ok) return;
    this.#list = (await response.json()).filter((episode) => episode.ended !== "open");
    const { $ } = this;
    $("#no-episodes").hidden = this.#list.length > 0;
    $("#episodes").replaceChildren(...this.#list.map((episode) => this.#item(episode)));
  }

  #item(episode) {
    const item = document.createElement("li");
    item.innerHTML = `<button class="icon" title="Play back">${icon("play")}</button><span><b></b><small></small></span>
      <a class="icon" title="Download" download>${icon("download")}</a><button class="icon" title="Delete">${icon("trash")}</button>`;
    const [play, remove] = item.querySelectorAll("button"), link = item.querySelector("a");
    item.querySelector("b").textContent = episode.label || when(episode.start);
    const ended = episode.ended === "truncated" ? " · cut off" : "";
    item.querySelector("small").textContent = `${episode.label ? `${when(episode.start)} · ` : ""}${clock(episode.seconds)}${ended}`;
    link.href = `/api/episodes/${episode.id}/download`;
    play.addEventListener("click", () => this.#play(episode));
    remove.addEventListener("click", () => this.#remove(remove, episode));
    return item;
  }

  async #play(episode) {
    try {
      this.stage.play(await Episode.fetch(episode.id));
      this.$("#playback-name").textContent = episode.label || when(episode.start);
    } catch (error) {
      this.controls.hint(error.message, true);
    }
  }

  #remove(button, episode) {
    if (button.dataset.sure) return this.#ask("DELETE", `/${episode.id}`);
    button.dataset.sure = "yes";
    button.title = "Press again to delete";
    setTimeout(() => delete button.dataset.sure, SURE_MS);
  }

  async #ask(method, path, body) {
    const headers = { "Content-Type": "application/json" };
    const options = { method, ...(body ? { headers, body: JSON.stringify(body) } : {}) };
    const response = await fetch(`/api/episodes${path}`, options).catch(() => null);
    if (response?.ok) this.refresh();
    else this.controls.hint(response ? (await response.json()).detail : "no connection to the robot", true);
  }

  #pause() {
    const { playback } = this.stage;
    if (!playback.playing && playback.time >= playback.seconds) playback.seek(0);
    playback.playing = !playback.playing;
  }

  #clock() {
    const { $, stage } = this;
    text($("#record span"), this.#recording ? clock((performance.now() - this.#since) / 1000) : "Record");
    if (!stage.playback) return;
    const { time, seconds, playing } = stage.playback;
    $("#playback-time").max = seconds;
    if (playing) $("#playback-time").value = time;
    text($("#playback-clock"), `${clock(time)} / ${clock(seconds)}`);
    const shown = playing ? "pause" : "play";
    if ($("#playback-toggle").dataset.shows !== shown) {
      $("#playback-toggle").dataset.shows = shown;
      $("#playback-toggle").innerHTML = icon(shown);
    }
  }
}

const clock = (seconds) => `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, "0")}`;
const when = (unix) => new Date(unix * 1000).toLocaleString([], { month: "short", day: "numeric", hour: "2-digit", minute: "2-digit" });
