// The crew: who drives what, who asks for it, and a link for another one's phone.

import { ask } from "./ask.js";
import { icon } from "./overlay.js";
import { ROLES } from "./roles.js";
import { text } from "./status.js";

const NAMES = { arms: "Arms", legs: "Legs" };
const ROWS = ROLES.map((role) => `<li data-role="${role}"><b>${NAMES[role]}</b><span></span>
  <button class="small" data-do="ask">Ask</button><button class="small" data-do="take">Take over</button>
  <button class="small" data-do="release">Let go</button></li>`).join("");

export class Crew {
  #invited = null;

  constructor($, roles) {
    Object.assign(this, { $, roles });
    $("#crew").innerHTML = `
      <header><strong>Who drives</strong><button class="icon" aria-label="Close">${icon("close")}</button></header>
      <ul>${ROWS}</ul>
      <p class="faint" id="crew-watchers"></p>
      <label>Your name <input id="name" type="text" maxlength="40" autocomplete="off"></label>
      <footer><span>Hand a role to a phone:</span><button class="small" data-invite="legs">Legs</button><button class="small" data-invite="arms">Arms</button></footer>
      <figure id="invite" hidden></figure>`;
    for (const button of [$("#crew-button"), $("#crew header button")]) button.addEventListener("click", () => this.toggle());
    for (const button of $.all("[data-do]")) {
      button.addEventListener("click", () => roles[button.dataset.do](button.parentElement.dataset.role));
    }
    for (const button of $.all("[data-invite]")) button.addEventListener("click", () => this.#invite(button.dataset.invite));
    $("#name").value = roles.name;
    $("#name").addEventListener("change", ({ target }) => roles.setName(target.value));
    $("#take").addEventListener("click", () => roles.take(...this.#missing()));
    $("#request button").addEventListener("click", () => this.asks && roles.give(this.asks));
  }

  toggle() {
    const { $ } = this;
    $("#crew").hidden = !$("#crew").hidden;
    $("#crew-button").setAttribute("aria-expanded", !$("#crew").hidden);
  }

  show(answer) {
    const { $, roles } = this;
    const { arms, legs } = answer.roles, mine = answer.drives;
    const who = (role) => (mine.includes(role) ? "you" : answer.roles[role].driver);
    const shared = who("arms") !== who("legs");
    const one = arms.driver && (mine.length ? "you drive" : `${arms.driver} drives`);
    text($("#driver"), shared ? `arms: ${who("arms") ?? "nobody"} · legs: ${who("legs") ?? "nobody"}` : one || "nobody drives");
    const watching = answer.crew.filter(({ drives }) => !drives.length);
    text($("#watchers"), watching.length === 1 ? "1 watches" : watching.length > 1 ? `${watching.length} watch` : "");
    this.#offer(answer);
    if ($("#crew").hidden) return;
    for (const row of $.all("#crew li")) this.#row(row, who(row.dataset.role), answer.roles[row.dataset.role].state);
    text($("#crew-watchers"), watching.length ? `Watching: ${watching.map(({ name, id }) => (id === answer.id ? "you" : name)).join(", ")}` : "");
    $("#name").placeholder = answer.you;
  }

  #row(row, who, state) {
    const role = row.dataset.role, mine = who === "you", free = !who;
    row.dataset.state = who ? state : "";
    text(row.querySelector("span"), who ?? "nobody");
    const asked = this.roles.asking && this.roles.wanted.includes(role) && !mine;
    const [ask, take, release] = row.querySelectorAll("button");
    ask.hidden = mine || free;
    ask.disabled = asked;
    text(ask, asked ? "Asked" : "Ask");
    take.hidden = mine;
    text(take, free ? "Drive" : "Take over");
    release.hidden = !mine;
  }

  // The one button of the status card, and whoever asks for what this page drives.
  #offer(answer) {
    const { $ } = this;
    const missing = this.#missing(), some = answer.drives.length > 0;
    $("#take").hidden = !answer.driver || !missing.length || (some && this.roles.other(missing[0]) !== null);
    text($("#take"), some ? `Drive the ${missing[0]} too` : "Take over");
    this.asks = answer.crew.find(({ asks }) => asks.some((role) => answer.drives.includes(role)));
    $("#request").hidden = !this.asks;
    if (this.asks) text($("#request span"), `${this.asks.name} asks for the ${this.asks.asks.join(" and ")}`);
  }

  // What the status card's button takes: all that this page wants, or the rest of the robot.
  #missing() {
    const { drives, wanted } = this.roles;
    const goal = drives.length ? ROLES : wanted.length ? wanted : ROLES;
    return goal.filter((role) => !drives.includes(role));
  }

  async #invite(role) {
    const figure = this.$("#invite");
    figure.hidden = this.#invited === role;
    this.#invited = figure.hidden ? null : role;
    if (figure.hidden) return;
    try {
      const { link, qr, reach } = await ask(`/api/invite/${role}`);
      figure.innerHTML = `<img alt="QR code" src="${qr}"><figcaption><a href="${link}" target="_blank">${link}</a></figcaption>`;
      if (reach) figure.querySelector("figcaption").append(reach);
    } catch ({ message }) {
      text(figure, message);
    }
  }
}
