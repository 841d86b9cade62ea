// The controls over the 3D view: their markup. A shadow root keeps viser's styles and ours apart.

import { STAGES } from "./latency.js";

const ICONS = {
  forward: '<path d="M12 19V6M6 11.5 12 5.5l6 6"/>',
  back: '<path d="M12 5v13M6 12.5l6 6 6-6"/>',
  left: '<path d="M19 12H6M11.5 6l-6 6 6 6"/>',
  right: '<path d="M5 12h13M12.5 6l6 6-6 6"/>',
  "turn-left": '<path d="M5 4v5h5M5.6 9A7.5 7.5 0 1 1 4.6 13.5"/>',
  "turn-right": '<path d="M19 4v5h-5M18.4 9a7.5 7.5 0 1 0 1 4.5"/>',
  reset: '<path d="M4.5 12a7.5 7.5 0 1 0 2.4-5.5L4.5 8.7M4.5 4v4.7h4.7"/>',
  help: '<path d="M9 9.2a3 3 0 1 1 4.4 2.7c-.9.5-1.4 1.1-1.4 2.1M12 17.6v.1"/>',
  panel: '<path d="M4 7h9M17 7h3M4 12h3M11 12h9M4 17h9M17 17h3M15 5v4M9 10v4M15 15v4"/>',
  play: '<path d="M8 5.5v13l10.5-6.5z" fill="currentColor"/>',
  pause: '<path d="M8.5 5.5v13M15.5 5.5v13"/>',
  close: '<path d="m6 6 12 12M18 6 6 18"/>',
  download: '<path d="M12 4v11M7 11l5 5 5-5M5 20h14"/>',
  trash: '<path d="M5 7h14M10 7V4.5h4V7M7 7l.8 12.5h8.4L17 7"/>',
};

export function icon(name) {
  return `<svg viewBox="0 0 24 24" aria-hidden="true">${ICONS[name]}</svg>`;
}

const pedal = (direction, name) =>
  `<button class="pedal" data-direction="${direction}" aria-label="${name}">${icon(direction)}<kbd data-keys="${direction}"></kbd></button>`;

const slider = (field, name, low, high, step, value, unit) => `
  <label class="slider"><span>${name}</span><output></output>
    <input type="range" data-field="${field}" min="${low}" max="${high}" step="${step}" value="${value}" data-unit="${unit}"></label>`;

const bar = (axis, name, unit) =>
  `<div class="bar" data-axis="${axis}" data-unit="${unit}"><span>${name}</span><i><b></b><u></u></i><output>0.00</output></div>`;

const stage = (name, label) => `<tr data-stage="${name}"><th>${label}</th><td></td></tr>`;

const MARKUP = `
<link rel="stylesheet" href="/web/overlay.css">
<main>
  <section class="status card">
    <p class="state" aria-live="polite"><i class="dot"></i><strong id="state">Connecting</strong><span id="reason"></span></p>
    <p class="crew"><button id="crew-button" title="Who drives what" aria-expanded="false"><span id="driver"></span><span id="watchers"></span></button><span id="factor"></span></p>
    <button id="take" class="small" hidden>Take over</button>
    <p id="request" aria-live="polite" hidden><span></span><button class="small">Hand over</button></p>
    <div class="members" id="crew" hidden></div>
  </section>

  <nav class="tools card">
    <div class="views" role="radiogroup" aria-label="View">
      <button role="radio" data-view="follow" title="The view walks with the robot">Follow</button>
      <button role="radio" data-view="eyes" title="What the robot's camera sees">Eyes</button>
      <button role="radio" data-view="free" title="The view stays where it is">Free</button>
    </div>
    <button id="reset" class="icon" title="Put the robot back home">${icon("reset")}</button>
    <button id="help-button" class="icon" title="Keys and help" aria-expanded="false">${icon("help")}</button>
    <button id="panel-button" class="icon" title="Posture, recording, details" aria-expanded="false">${icon("panel")}</button>
  </nav>

  <aside class="panel card" id="panel">
    <details open><summary>Recording</summary>
      <div class="record">
        <button id="record"><i></i><span>Record</span></button>
      </div>
      <div class="record" id="endings" hidden>
        <button id="success" class="small" title="Stop: it went well">✓ Success</button>
        <button id="failure" class="small" title="Stop: it went wrong">✗ Failure</button>
        <button id="discard" class="small" title="Stop and forget it"><span>Discard</span></button>
      </div>
      <input id="label" type="text" maxlength="200" placeholder="Task, for example: wave with the left hand" aria-label="Task of the episode">
      <label class="check"><input type="checkbox" id="fresh"> Reset after each episode, to another start</label>
      <p id="counters" class="faint" title="Episodes, their time, successes, failures"></p>
      <ul id="episodes"></ul>
      <p id="no-episodes" class="faint">Nothing recorded yet.</p>
    </details>
    <details open><summary>Posture</summary>
      ${slider("height", "Height", "", "", 0.005, 1, "m")}
      ${slider("pitch", "Lean forward", "", "", 0.01, 0, "°")}
      ${slider("roll", "Lean right", "", "", 0.01, 0, "°")}
      ${slider("waist", "Waist", -0.8, 0.8, 0.02, 0, "°")}
      <button id="straight" class="small">Straighten up</button>
    </details>
    <details><summary>Hands and head</summary>
      ${slider("grip-left", "Left hand closes", 0, 1, 0.02, 0, "%")}
      ${slider("pinch-left", "Left hand pinches", 0, 1, 0.02, 0, "%")}
      ${slider("grip-right", "Right hand closes", 0, 1, 0.02, 0, "%")}
      ${slider("pinch-right", "Right hand pinches", 0, 1, 0.02, 0, "%")}
      ${slider("neck-yaw", "Head turn", -1.2, 1.2, 0.02, 0, "°")}
      ${slider("neck-pitch", "Head down", -0.6, 1.1, 0.02, 0.3, "°")}
      <label class="check"><input type="checkbox" id="gaze"> The head looks at the hands</label>
      <p class="check"><a href="/xr">Drive with a headset</a></p>
    </details>
    <details><summary>Driving</summary>
      <label class="choice" id="legs" hidden><span>Legs</span><select></select></label>
      <label class="check"><input type="checkbox" id="forecast"> Show what the prior expects</label>
      <p id="expected" class="faint" title="How far the wrists were from where the motion prior of the legs had expected them, over the last 10 s"></p>
      ${slider("pace", "Walk", 0.1, "", 0.05, 0.5, "m/s")}
      ${slider("side", "Sidestep", 0.05, "", 0.05, 0.25, "m/s")}
      ${slider("turn", "Turn", 0.1, "", 0.05, 0.6, "rad/s")}
      ${slider("deadZone", "Dead zone of sticks", 0, 0.4, 0.02, 0.12, "%")}
      ${slider("curve", "Response of sticks", 1, 3, 0.1, 1.6, "")}
      <label class="check"><input type="checkbox" id="latch"> A tap on Engage keeps it pressed</label>
      <label class="check"><input type="checkbox" id="smooth"> Smooth the wrists, for an unsteady hand</label>
    </details>
    <details><summary>Timing</summary>
      <p class="stages" id="stages" title="From the hand to the picture">${STAGES.map(() => "<i></i>").join("")}</p>
      <table>${[
        stage("device", "mouse, key or pad"), stage("network", "network"), stage("queue", "wait for the tick"), stage("ik", "arms"),
        stage("policy", "legs"), stage("physics", "physics"), stage("publish", "publish"), stage("stream", "stream"),
        stage("picture", "picture"), stage("total", "hand to picture"), stage("filter", "filter of the wrists"),
        stage("lateness", "tick late by"), stage("frames", "frames a second"), stage("missed", "ticks missed"),
      ].join("")}</table>
    </details>
  </aside>

  <section class="speeds card" aria-label="Commanded and measured velocity">
    ${bar("vx", "ahead", "m/s")}${bar("vy", "left", "m/s")}${bar("yaw_rate", "turn", "rad/s")}
  </section>

  <section class="deck">
    <p class="hint" id="hint" role="status"></p>
    <button id="engage"><span>Engage</span><kbd data-keys="engage"></kbd></button>
    <div class="pedals">
      ${pedal("turn-left", "Turn left")}${pedal("forward", "Walk forward")}${pedal("turn-right", "Turn right")}
      ${pedal("left", "Step left")}${pedal("back", "Walk back")}${pedal("right", "Step right")}
    </div>
    <button id="stop"><span>Stop</span><kbd data-keys="stop"></kbd></button>
  </section>

  <section class="alarm card" id="alarm" role="alert" hidden><strong>Recording</strong><span></span></section>
  <section class="playback card" id="playback" hidden>
    <strong>Playback</strong><span id="playback-name"></span>
    <button id="playback-toggle" class="icon" aria-label="Play or pause">${icon("pause")}</button>
    <span class="timeline"><input id="playback-time" type="range" min="0" max="1" step="0.01" value="0" aria-label="Time"><i id="playback-events"></i></span>
    <output id="playback-clock"></output>
    <button id="playback-close" class="icon" aria-label="Back to the robot">${icon("close")}</button>
    <table id="figures"></table>
    <select id="against" aria-label="Compare with"></select><button id="swap" class="small" hidden>Show the other</button>
  </section>

  <section class="help card" id="help" role="dialog" aria-label="Keys and help" hidden></section>
  <section class="lost" id="lost" hidden><p class="card"><strong>Connection lost</strong><span>The robot holds still. Trying again.</span></p></section>
</main>`;

// Put the controls into the document. Returns $(selector) for one and $.all(selector) for all of their elements.
export function mount() {
  const host = document.createElement("div");
  host.id = "teleop";
  const root = host.attachShadow({ mode: "open" });
  root.innerHTML = MARKUP;
  document.body.append(host);
  const $ = (selector) => root.querySelector(selector);
  $.all = (selector) => [...root.querySelectorAll(selector)];
  $.host = host;
  return $;
}

// Let sliders and bars go as far as the legs were trained. trained: from GET /api/scene.
export function fit($, { vx, vy, yaw_rate, ...posture }) {
  for (const [field, axis, full] of [["pace", "vx", vx[1]], ["side", "vy", vy[1]], ["turn", "yaw_rate", yaw_rate[1]]]) {
    $(`[data-field=${field}]`).max = full;
    $(`[data-axis=${axis}]`).dataset.full = full;
  }
  for (const [field, [min, max]] of Object.entries(posture)) Object.assign($(`[data-field=${field}]`), { min, max });
}
