// Puts the page together.

import { ask, insist } from "./ask.js";
import { Controls } from "./controls.js";
import { Crew } from "./crew.js";
import { Episodes } from "./episodes.js";
import { Forecast } from "./forecast.js";
import { Hands } from "./hands.js";
import { Help } from "./help.js";
import { Keys } from "./keys.js";
import { Latency } from "./latency.js";
import { Legs } from "./legs.js";
import { Link } from "./link.js";
import { fit, mount } from "./overlay.js";
import { Pads } from "./pads.js";
import { Pilot } from "./pilot.js";
import { Roles } from "./roles.js";
import { Live } from "./sources.js";
import { Stage } from "./stage.js";
import { Status } from "./status.js";
import { followTheme } from "./theme.js";
import { Viewer } from "./viewer.js";
import { Wrists } from "./wrists.js";

const VIEWS = ["follow", "eyes", "free"];
const WELCOME = "Press Engage, then hold W to walk or drag a wrist.";
const WELCOME_TOUCH = "Tap Engage, then hold an arrow to walk or drag a wrist.";

const socket = (path) => `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${path}`;

const viewer = new Viewer(window.teleopTap); // first of all: it listens while viser starts
const keys = new Keys();
const pads = new Pads();
const $ = mount();
document.title = "Teleop";
const description = await insist("/api/scene", () => ($("#lost").hidden = false));
fit($, description.trained);

const live = new Live(socket("/api/scene"));
const stage = new Stage(viewer, description, live);
const roles = new Roles(new URLSearchParams(location.search).get("role"));
const pilot = new Pilot(roles, description.trained);
const latency = new Latency();
const fields = (seq) => ({ ...roles.fields(seq), ...pilot.fields(), ...wrists.fields(), ...latency.fields() });
const link = new Link(socket("/api/operator"), fields);
const wrists = new Wrists(viewer, stage, pilot, roles, link, description.wrists);
const status = new Status($, roles, latency, live);
const crew = new Crew($, roles);

const actions = {
  stop: () => (pilot.letGo(), ask("/api/stop", "POST").catch(({ message }) => controls.hint(`Stop did not reach the robot: ${message}`, true))),
  reset: () => reset(),
  record: () => episodes.toggle(),
  success: () => episodes.end(true),
  failure: () => episodes.end(false),
  discard: () => episodes.discard(),
  view: () => (stage.view = VIEWS[(VIEWS.indexOf(stage.view) + 1) % VIEWS.length]),
};
const hands = new Hands($, pilot, stage, description);
Object.assign(actions, hands.actions);
const controls = new Controls($, pilot, [keys, pads], actions);
const episodes = new Episodes($, stage, controls, reset);
const legs = new Legs($, post);
new Forecast($, stage);
new Help($, keys, pads, controls);
followTheme($, viewer);
window.teleop = { live, latency }; // for the console and for `teleop-bench latency`

// ---- the operator's word goes out when it changes, and every 50 ms

pilot.addEventListener("change", () => {
  if (pilot.engaged && stage.playback) stage.play(null); // nobody drives blind
  tell();
});
stage.addEventListener("playback", () => stage.playback && pilot.letGo());
wrists.addEventListener("drag", () => tell());
for (const type of ["down", "move", "up"]) pads.addEventListener(type, () => latency.moved());
$("#smooth").checked = wrists.smooth;
$("#smooth").addEventListener("change", ({ target }) => wrists.setSmooth(target.checked));
wrists.addEventListener("idle-drag", () => controls.hint("press Engage first (hold Space), then drag", true));
addEventListener("pagehide", () => link.send());
roles.addEventListener("change", () => link.send());

function tell() {
  latency.sends();
  link.send();
}

// Ask for something as this client. Resolves to whether it was done; else the page says why not.
async function post(path, body, query = {}) {
  try {
    await ask(`${path}?${new URLSearchParams({ client: link.id, ...query })}`, "POST", body);
    return true;
  } catch ({ message }) {
    controls.hint(message, true);
    return false;
  }
}

// Put the robot back; a seed other than 0 draws a start near home. Resolves to whether it was done.
async function reset(seed = 0) {
  pilot.letGo();
  stage.play(null);
  return post("/api/reset", undefined, { seed });
}

// ---- what comes back

link.addEventListener("answer", ({ detail: answer }) => {
  roles.hear(answer);
  pilot.hear(answer);
  status.show(answer);
  crew.show(answer);
  controls.follow({ ...answer.command, ...hands.fields(answer.command) });
  wrists.show(answer);
  hands.show(answer);
  legs.show(answer);
  episodes.show(answer);
  if (answer.error) controls.hint(answer.error, true);
});
let way = 0; // of a message, one way [ms]
link.addEventListener("timed", ({ detail }) => latency.note("network", (way = detail)));
live.addEventListener("shown", ({ detail: { age, waited } }) => {
  latency.note("stream", age + way);
  latency.note("picture", waited);
});
link.addEventListener("open", () => ($("#lost").hidden = true));
link.addEventListener("close", () => {
  pilot.letGo();
  status.lost();
  $("#lost").hidden = false;
});

// ---- views and panels

for (const button of $.all("[data-view]")) {
  button.addEventListener("click", () => {
    if (button.dataset.view === "follow" && stage.view === "follow") stage.recentre();
    else stage.view = button.dataset.view;
  });
}
function showView() {
  for (const button of $.all("[data-view]")) button.setAttribute("aria-checked", button.dataset.view === stage.view);
}
stage.addEventListener("view", showView);
showView();

const roomy = matchMedia("(min-width: 1000px) and (min-height: 560px)");
function openPanel(open) {
  $("#panel").hidden = !open;
  $("#panel-button").setAttribute("aria-expanded", open);
}
$("#panel-button").addEventListener("click", () => openPanel($("#panel").hidden));
openPanel(roomy.matches);

if (!localStorage.getItem("teleop welcomed")) {
  controls.hint(matchMedia("(pointer: coarse)").matches ? WELCOME_TOUCH : WELCOME);
  pilot.addEventListener("change", () => localStorage.setItem("teleop welcomed", "yes"), { once: true });
}
