// Puts the headset's page together. Without a headset it is a preview: the same picture, flat.

import { ask, insist } from "./ask.js";
import { Board } from "./board.js";
import { atHands } from "./gaze.js";
import { Immersion } from "./immersion.js";
import { Keys } from "./keys.js";
import { forward } from "./kinematics.js";
import { Link } from "./link.js";
import { inverse, multiply, perspective } from "./matrix.js";
import { Packet } from "./packet.js";
import { Pads } from "./pads.js";
import { fetchMeshes, Painter } from "./painter.js";
import { Pilot } from "./pilot.js";
import { Swing } from "./reach.js";
import { Roles } from "./roles.js";
import { Seat } from "./seat.js";
import { Live } from "./sources.js";
import { text } from "./status.js";
import { Sticks } from "./sticks.js";
import { Tracker } from "./tracker.js";

const PERIOD_MS = 1000 / 60; // of packets
const VIEWS = ["behind", "eyes", "none"];
const DOT = 0.006; // radius of a joint of the person's own hands [m]
const HEARTBEAT_MS = 50; // timers may rest while a headset shows a session; its frames then send what the timer would
const PAIR = { width: 640, height: 480 }; // of each picture of a stereo pair
const FLAT = { fov: 0.75, from: [-2.6, 1.2, 1.7], at: [0, 0, 0.8] };

const $ = (id) => document.getElementById(id);
const socket = (path) => `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${path}`;
const stored = (name, otherwise) => localStorage.getItem(`teleop ${name}`) ?? otherwise;
const store = (name, value) => localStorage.setItem(`teleop ${name}`, value);

const [layout, description] = await Promise.all(["/api/headset", "/api/scene"].map((path) => insist(path, () => text($("state"), "No connection"))));
const packet = new Packet(layout), tracker = new Tracker(), seat = new Seat(description);
const live = new Live(socket("/api/scene"));
const roles = new Roles(new URLSearchParams(location.search).get("role"));
const pilot = new Pilot(roles, description.trained), sticks = new Sticks(pilot);
const gl = $("picture").getContext("webgl2", { antialias: true, xrCompatible: true });
const immersion = new Immersion(gl);

let answer = null, poses = null, painter = null, arms = true, lastSent = 0, due = 0;
let measured = null, note = ""; // the arms while they are measured, and what the board says about it
const choice = { view: stored("headset view", "behind"), neck: stored("headset neck", "head") };
const link = new Link(socket("/api/operator"), (seq) => {
  lastSent = performance.now();
  return { ...roles.fields(seq), ...pilot.fields(), ...looks(), smooth: $("steady").checked };
});

function looks() {
  if (!pilot.engaged || choice.neck !== "hands" || !answer || !poses) return {};
  return { neck: atHands(description, poses, answer.wrists) };
}

// ---- what a person can do, on the page, on the board, on keys

const engage = () => ((measured = null), pilot.engaged ? pilot.letGo() : pilot.press());
const stop = () => (pilot.letGo(), ask("/api/stop", "POST").catch(({ message }) => text($("reason"), (note = `Stop did not reach the robot: ${message}`))));
const actions = { stop, view: () => setView(VIEWS[(VIEWS.indexOf(choice.view) + 1) % VIEWS.length]) };
const board = new Board([
  { label: () => (pilot.engaged ? "Release" : "Engage"), colour: () => (pilot.engaged ? "#0b8f6a" : ""), press: engage },
  { label: () => "Stop", colour: () => "#d1373f", press: stop },
  { label: () => "Recentre", press: () => immersion.recentre() },
  { label: () => (arms ? "Hold the arms" : "Move the arms"), press: () => setArms(!arms) },
  { label: () => (choice.view === "behind" ? "See by its eyes" : "See it from behind"), press: () => setView(choice.view === "behind" ? "eyes" : "behind") },
  { label: () => (measured ? "Swing your arms" : "Measure my arms"), press: () => measure() },
  { label: () => "Leave", press: () => immersion.leave() },
]);

for (const device of [new Keys(), new Pads()]) pilot.listen(device, actions);
$("engage").addEventListener("click", engage);
$("stop").addEventListener("pointerdown", stop);
$("stop").addEventListener("click", (event) => event.detail === 0 && stop()); // by Enter or an assistive tool
$("recentre").addEventListener("click", () => immersion.recentre());
$("take").addEventListener("click", () => roles.take(...roles.wanted));
$("enter").addEventListener("click", () => immersion.enter().catch((error) => text($("support"), `The headset refused: ${error.message}`)));
$("pair").addEventListener("click", () => savePair());
$("view").addEventListener("change", ({ target }) => setView(target.value));
$("neck").addEventListener("change", ({ target }) => store("headset neck", (choice.neck = target.value)));
$("arms").addEventListener("change", ({ target }) => setArms(target.checked));
$("smooth").addEventListener("change", ({ target }) => (seat.smooth = target.checked));
$("arm").addEventListener("change", ({ target }) => store("arm", target.value));
$("arm").value = stored("arm", "0.56");
$("steady").checked = stored("headset steady", "yes") === "yes";
$("steady").addEventListener("change", ({ target }) => store("headset steady", target.checked ? "yes" : "no"));
$("neck").value = choice.neck;
setView(choice.view);

function setArms(follow) {
  $("arms").checked = arms = follow;
}

// The operator's reach, mapped to the robot's: swing both arms, straight, and the shoulders still.
function measure() {
  pilot.letGo();
  measured = new Swing(performance.now());
  note = "Stretch both arms, then swing them straight, up and to the sides";
}

function takeMeasure() {
  const found = measured?.take(tracker.wrists, performance.now());
  if (!found) return;
  measured = null;
  note = found.arm ? "" : `Not measured: ${found.why}`;
  if (found.arm) store("arm", ($("arm").value = found.arm.toFixed(2)));
}

function setView(view) {
  $("view").value = choice.view = view;
  store("headset view", view);
  seat.view = view === "eyes" ? "eyes" : "behind";
  seat.recentre(tracker.head);
}

// ---- whatever takes the person away from the robot lets go of it

const letGo = () => pilot.letGo();
immersion.addEventListener("hidden", letGo);
immersion.addEventListener("end", letGo);
addEventListener("pagehide", () => (letGo(), link.send()));
addEventListener("blur", () => immersion.active || letGo());
document.addEventListener("visibilitychange", () => document.hidden && !immersion.active && letGo());

pilot.addEventListener("change", () => {
  if (pilot.engaged) note = "";
  link.send();
});
pilot.addEventListener("refused", ({ detail }) => text($("reason"), detail));
roles.addEventListener("change", () => link.send());
link.addEventListener("close", () => {
  letGo();
  document.body.dataset.state = "LOST";
  text($("state"), "No connection");
});
link.addEventListener("answer", ({ detail }) => {
  answer = detail;
  roles.hear(answer);
  pilot.hear(answer);
  document.body.dataset.state = answer.state;
  text($("state"), answer.state);
  text($("reason"), answer.error ?? (note || answer.reason));
  text($("crew"), answer.driving ? `you drive: ${answer.drives.join(" and ")}` : answer.driver ? `${answer.driver} drives` : "nobody drives");
  $("take").hidden = !roles.wanted.some((role) => roles.other(role));
  $("engage").setAttribute("aria-pressed", pilot.engaged);
});

// ---- the headset: every frame is read and told first, then drawn

let seated = false, head = null, then = 0, pressed = {};
const told = { sent: 0, skipped: 0, since: performance.now() };
immersion.addEventListener("moved", () => (seated = false));
immersion.addEventListener("frame", ({ detail: { frame, now, space, layer } }) => {
  packet.clear();
  const controllers = tracker.read(frame, space, packet);
  tell(controllers, now);
  takeMeasure();
  if (tracker.head && !seated) {
    seat.recentre(tracker.head);
    board.recentre(tracker.head);
    seated = true;
  }
  head = tracker.head ?? head;
  sticks.read(tracker.sticks);
  for (const [button, act] of [["engage", engage], ["stop", stop]]) {
    if (tracker.buttons[button] && !pressed[button]) act();
  }
  pressed = tracker.buttons;
  press(frame, space);
  if (performance.now() - lastSent > HEARTBEAT_MS) link.send();
  draw(frame, space, layer, now);
});

// Send this frame's packet; a frame that comes too soon after the one before, or while that is still on its way, is left out.
function tell(controllers, now) {
  if (now < due - PERIOD_MS / 4) return;
  due = Math.max(due + PERIOD_MS, now);
  const asks = ["LEFT_ARM", "RIGHT_ARM"].filter((_, side) => arms && (!controllers.includes(side) || tracker.squeezed[side]));
  const wanted = pilot.engaged ? ["FINGERS", ...asks, ...(choice.neck === "head" ? ["NECK"] : [])] : [];
  packet.set("asks", [wanted.reduce((bits, name) => bits | packet.asks[name], 0)]);
  packet.set("origin", [immersion.origin]);
  packet.set("time", [now / 1000]);
  packet.set("arm", [Number($("arm").value) || 0]);
  const sent = link.sendPacket((seq) => (packet.set("seq", [seq]), packet.bytes));
  sent ? told.sent++ : told.skipped++;
}

setInterval(() => {
  const seconds = (performance.now() - told.since) / 1000;
  if (immersion.active) text($("packets"), `${(told.sent / seconds).toFixed(0)} packets a second, ${told.skipped} left out`);
  Object.assign(told, { sent: 0, skipped: 0, since: performance.now() });
}, 1000);

// Fingertips, triggers of controllers and, while the fingers do not drive the robot's, pinches press the board.
function press(frame, space) {
  board.touch(tracker.hands.map((hand) => hand?.tip ?? null));
  for (const { handedness, targetRaySpace, targetRayMode, hand, gamepad } of frame.session.inputSources) {
    const side = ["left", "right"].indexOf(handedness);
    if (side < 0 || targetRayMode === "transient-pointer") continue;
    if (hand) {
      const { tip, pinch } = tracker.hands[side] ?? {};
      if (tip && head) board.point(side, three(head.position), tip, pinch && !pilot.engaged);
      continue;
    }
    const ray = frame.getPose(targetRaySpace, space)?.transform;
    if (!ray) continue;
    const from = three(ray.position), m = ray.matrix;
    for (let way = 0.1; way < 0.6; way += 0.05) tracker.points.push([0, 1, 2].map((i) => from[i] - way * m[8 + i]));
    board.point(side, from, [from[0] - m[8], from[1] - m[9], from[2] - m[10]], Boolean(gamepad?.buttons[0]?.pressed));
  }
}

const three = ({ x, y, z }) => [x, y, z];

function draw(frame, space, layer, now) {
  const elapsed = Math.min(0.2, (now - then) / 1000);
  then = now;
  show();
  const viewer = frame.getViewerPose(space);
  gl.bindFramebuffer(gl.FRAMEBUFFER, layer.framebuffer);
  if (!painter || !viewer || !poses) return;
  painter.clear();
  const world = seat.place(poses, elapsed), changed = board.paint(answer?.state ?? "LOST", note || (answer?.reason ?? ""));
  for (const view of viewer.views) {
    const eye = view.transform.inverse.matrix, port = layer.getViewport(view);
    if (choice.view === "none") gl.viewport(port.x, port.y, port.width, port.height);
    else painter.draw(view.projectionMatrix, multiply(eye, world), port, poses, seat.hidden);
    painter.drawDots(view.projectionMatrix, eye, port, tracker.points, DOT);
    if (board.place) painter.drawBoard(view.projectionMatrix, multiply(eye, board.place), board.size, board.canvas, changed && view === viewer.views[0]);
  }
}

function show() {
  const qpos = live.next(performance.now());
  if (qpos) poses = forward(description.bodies, qpos);
  return Boolean(qpos);
}

// ---- the flat preview

const orbit = { yaw: 0, pitch: 0 };
$("picture").addEventListener("pointermove", (event) => {
  if (!event.buttons) return;
  orbit.yaw -= event.movementX / 200;
  orbit.pitch = Math.min(0.5, Math.max(-0.9, orbit.pitch + event.movementY / 200));
});

function preview() {
  requestAnimationFrame(preview);
  if (immersion.active || !painter || choice.view === "none" || !show()) return;
  if (!poses) return;
  const canvas = $("picture"), [width, height] = [canvas.clientWidth, canvas.clientHeight].map((x) => Math.round(x * Math.min(devicePixelRatio, 2)));
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  painter.clear();
  const port = { x: 0, y: 0, width, height };
  if (choice.view === "eyes") painter.draw(perspective(description.eye.fov, width / height, 0.03, 60), seat.camera(poses), port, poses, seat.head);
  else painter.draw(perspective(FLAT.fov, width / height, 0.03, 60), around(), port, poses, null);
}

// From behind and beside the robot, turned as the pointer dragged.
function around() {
  const [x, y] = poses[description.pelvis].position, distance = Math.hypot(...FLAT.from);
  const yaw = Math.atan2(FLAT.from[1], FLAT.from[0]) + orbit.yaw, pitch = Math.asin(FLAT.from[2] / distance) * 0.5 + orbit.pitch;
  const back = [Math.cos(yaw) * Math.cos(pitch), Math.sin(yaw) * Math.cos(pitch), Math.sin(pitch)];
  const right = [-Math.sin(yaw), Math.cos(yaw), 0];
  const up = [back[1] * right[2] - back[2] * right[1], back[2] * right[0] - back[0] * right[2], back[0] * right[1] - back[1] * right[0]];
  const spot = [x, y, FLAT.at[2]].map((v, i) => v + distance * back[i]);
  return inverse([...right, 0, ...up, 0, ...back, 0, ...spot, 1]);
}

// Both pictures of the robot's eyes side by side, as a file.
function savePair() {
  if (!painter || !poses || immersion.active) return;
  const canvas = $("picture"), { width, height } = PAIR;
  Object.assign(canvas, { width: 2 * width, height });
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  painter.clear();
  const projection = perspective(description.eye.fov, width / height, 0.03, 60);
  [-1, 1].forEach((side, i) => painter.draw(projection, seat.camera(poses, side), { x: i * width, y: 0, width, height }, poses, seat.head));
  canvas.toBlob((blob) => {
    const a = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: "stereo_pair.png" });
    a.click();
    URL.revokeObjectURL(a.href);
  });
}

const why = await Immersion.missing();
text($("support"), why ? `${why} This is a preview.` : "");
$("enter").hidden = Boolean(why);
if (gl) painter = new Painter(gl, await fetchMeshes());
requestAnimationFrame(preview);
