// The status strip: what the robot does, and how well.

const WORDS = { STOPPED: "Stopped", HOLD: "Holding", ENGAGED: "Engaged", FAULT: "Fault" };
const SHOW_MS = 100; // figures that change faster cannot be read
const AXES = ["vx", "vy", "yaw_rate"];

export class Status {
  #shown = 0;
  #frames = { count: 0, at: 0, rate: 0 };

  constructor($, roles, latency, live) {
    Object.assign(this, { $, roles, latency, live });
    this.bars = $.all(".bar").map((element) => ({
      full: Number(element.dataset.full),
      axis: element.dataset.axis,
      asked: element.querySelector("u"),
      measured: element.querySelector("b"),
      figure: element.querySelector("output"),
    }));
  }

  show(answer) {
    const { $ } = this, { state, reason } = this.roles.own;
    $.host.dataset.state = state;
    const now = performance.now();
    if (now - this.#shown < SHOW_MS) return;
    this.#shown = now;
    text($("#state"), WORDS[state]);
    text($("#reason"), reason.replace(/^stopped; /, "")); // the word stands before it already
    text($("#factor"), `${answer.real_time_factor.toFixed(2)}× real time`);
    this.bars.forEach((bar) => showBar(bar, answer.command[bar.axis], answer.base[bar.axis]));
    this.#timing(answer, now);
  }

  lost() {
    const { $ } = this;
    $.host.dataset.state = "LOST";
    text($("#state"), "No connection");
    text($("#reason"), "");
    AXES.forEach((_, i) => showBar(this.bars[i], 0, 0));
  }

  #timing(answer, now) {
    const frames = this.#frames;
    if (now - frames.at > 1000) {
      frames.rate = ((this.live.frames - frames.count) * 1000) / (now - frames.at);
      Object.assign(frames, { count: this.live.frames, at: now });
    }
    const stages = this.latency.of(answer), total = stages.reduce((sum, [, value]) => sum + value, 0);
    const values = { ...Object.fromEntries(stages.map(([stage, value]) => [stage, ms(value)])), total: ms(total) };
    Object.assign(values, { lateness: ms(answer.latency_ms.lateness), filter: answer.filter_ms ? ms(answer.filter_ms) : "off" });
    Object.assign(values, { frames: frames.rate.toFixed(0), missed: answer.missed });
    for (const [stage, value] of Object.entries(values)) text(this.$(`[data-stage=${stage}] td`), value);
    stages.forEach(([, value], i) => (this.$("#stages").children[i].style.flexGrow = value));
  }
}

const ms = (value) => `${value < 10 ? value.toFixed(2) : value.toFixed(0)} ms`;

export function text(element, value) {
  if (element.textContent !== String(value)) element.textContent = value;
}

function showBar({ full, asked, measured, figure }, command, actual) {
  const percent = (value) => 50 + 50 * Math.max(-1, Math.min(1, value / full));
  asked.style.left = `${percent(command)}%`;
  asked.style.opacity = Math.abs(command) > 0.005 ? 1 : 0;
  const at = percent(actual);
  measured.style.left = `${Math.min(50, at)}%`;
  measured.style.width = `${Math.abs(at - 50)}%`;
  text(figure, actual.toFixed(2).replace("-0.00", "0.00"));
}
