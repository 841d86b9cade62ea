// A recorded episode shown instead of the robot: its timeline, what happened in it, how well it went, and another one beside it.

import { icon } from "./overlay.js";
import { Episode } from "./sources.js";
import { text } from "./status.js";

const PERCENT = (share) => `${(100 * share).toFixed(0)} %`;
// Figure -> heading and how to write it.
const FIGURES = {
  falls: ["falls", String],
  holds: ["let go", String],
  wrist_error: ["wrists off", (metres) => `${(1000 * metres).toFixed(0)} mm`],
  wrist_turn: ["turned", (radians) => `${((180 / Math.PI) * radians).toFixed(1)}°`],
  velocity_error: ["speed off", (speed) => `${speed.toFixed(2)} m/s`],
  jerk: ["jerk", (jerk) => `${jerk.toFixed(0)} m/s³`],
  at_limit: ["arm at limit", PERCENT],
};

export class Playback {
  #shown = null; // {record, episode, summary}
  #other = null; // the one to compare with

  constructor($, stage, controls) {
    Object.assign(this, { $, stage, controls });
    $("#playback-close").addEventListener("click", () => stage.play(null));
    $("#playback-toggle").addEventListener("click", () => this.#pause());
    $("#playback-time").addEventListener("input", ({ target }) => this.#seek(Number(target.value)));
    $("#against").addEventListener("change", ({ target }) => this.#compare(target.value));
    $("#swap").addEventListener("click", () => this.#swap());
    stage.addEventListener("playback", () => ($("#playback").hidden = !stage.playback));
    setInterval(() => this.#clock(), 100);
  }

  // The episodes that one can compare with: EpisodeRecord of app/episodes.py.
  list(records) {
    this.records = records;
    this.#choices();
  }

  async show(record) {
    await this.#try(async () => {
      this.#shown = await load(record);
      this.#other = null;
      this.stage.play(this.#shown.episode);
      this.#draw();
    });
  }

  async #compare(id) {
    const record = this.records.find((record) => record.id === id);
    await this.#try(async () => (this.#other = record ? await load(record) : null));
    this.#draw();
  }

  // The other one, at the same time.
  #swap() {
    const { time, playing } = this.#shown.episode;
    [this.#shown, this.#other] = [this.#other, this.#shown];
    Object.assign(this.#shown.episode, { playing });
    this.#shown.episode.seek(time);
    this.stage.play(this.#shown.episode);
    this.#draw();
  }

  #draw() {
    const { $ } = this;
    $("#playback-name").textContent = name(this.#shown.record);
    $("#swap").hidden = !this.#other;
    $("#playback-events").replaceChildren(...this.#shown.summary.events.map((event) => this.#mark(event)));
    const rows = [this.#shown, this.#other].filter(Boolean);
    const table = $("#figures");
    table.replaceChildren(row("th", ["", ...Object.values(FIGURES).map(([heading]) => heading)]));
    table.append(...rows.map(({ record, summary }) => row("td", [name(record), ...figures(summary.quality)])));
    table.hidden = rows.every(({ summary }) => !summary.quality);
    this.#choices();
  }

  #choices() {
    const others = this.records.filter(({ id }) => id !== this.#shown?.record.id);
    this.$("#against").replaceChildren(new Option("compare with …", ""), ...others.map((record) => new Option(name(record), record.id)));
    this.$("#against").value = this.#other?.record.id ?? "";
    this.$("#against").hidden = !others.length;
  }

  #mark({ seconds, kind, text: what }) {
    const mark = document.createElement("button");
    mark.dataset.kind = kind;
    mark.title = `${clock(seconds)} ${what}`;
    mark.style.left = PERCENT(seconds / Math.max(this.#shown.record.seconds, 0.02));
    mark.addEventListener("click", () => this.#seek(seconds));
    return mark;
  }

  #seek(time) {
    const { playback } = this.stage;
    if (!playback) return;
    playback.playing = false;
    playback.seek(time);
    this.$("#playback-time").value = time;
  }

  #pause() {
    const { playback } = this.stage;
    if (!playback.playing && playback.time >= playback.seconds) playback.seek(0);
    playback.playing = !playback.playing;
  }

  #clock() {
    const { $, stage } = this;
    if (!stage.playback) return;
    const { time, seconds, playing } = stage.playback;
    $("#playback-time").max = seconds;
    if (playing) $("#playback-time").value = time;
    $("#playback-time").style.setProperty("--share", seconds ? time / seconds : 0);
    text($("#playback-clock"), `${clock(time)} / ${clock(seconds)}`);
    const shown = playing ? "pause" : "play";
    if ($("#playback-toggle").dataset.shows !== shown) {
      $("#playback-toggle").dataset.shows = shown;
      $("#playback-toggle").innerHTML = icon(shown);
    }
  }

  async #try(what) {
    try {
      await what();
    } catch (error) {
      this.controls.hint(error.message, true);
    }
  }
}

// An episode that cannot be judged (a model of another MuJoCo) can still be watched.
async function load(record) {
  const [episode, answer] = await Promise.all([Episode.fetch(record.id), fetch(`/api/episodes/${record.id}/summary`)]);
  return { record, episode, summary: answer.ok ? await answer.json() : { quality: null, events: [] } };
}

function row(kind, cells) {
  const line = document.createElement("tr");
  line.append(...cells.map((cell) => Object.assign(document.createElement(kind), { textContent: cell })));
  return line;
}

const figures = (quality) => Object.entries(FIGURES).map(([key, [, write]]) => (quality?.[key] == null ? "–" : write(quality[key])));

export const name = (record) => record.label || when(record.start);
export const clock = (seconds) => `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, "0")}`;
export const when = (unix) => new Date(unix * 1000).toLocaleString([], { month: "short", day: "numeric", hour: "2-digit", minute: "2-digit" });
