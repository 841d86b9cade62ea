// Draws the robot on its floor with WebGL2, from any eye: for a headset's two, for the page, for a stereo pair.

import { fromPose, multiply } from "./matrix.js";

const SUN = [0.35, 0.25, 1]; // direction to the light; shadows fall along it
const SKY = [0.79, 0.83, 0.89], SHADOW = [0.74, 0.765, 0.81];

const BODY_VERTEX = `#version 300 es
uniform mat4 clip, model;
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
out vec3 n;
void main() {
  n = mat3(model) * normal;
  gl_Position = clip * model * vec4(position, 1.0);
}`;
const BODY_FRAGMENT = `#version 300 es
precision mediump float;
uniform vec3 rgb, sun;
uniform bool shadow;
in vec3 n;
out vec4 colour;
void main() {
  if (shadow) { colour = vec4(rgb, 1.0); return; }
  vec3 u = normalize(n);
  float light = 0.42 + 0.16 * u.z + 0.5 * max(dot(u, sun), 0.0);
  colour = vec4(rgb * light + 0.05 * pow(max(dot(u, sun), 0.0), 12.0), 1.0);
}`;
const FLOOR_VERTEX = `#version 300 es
uniform mat4 clip;
uniform vec2 middle;
layout(location = 0) in vec2 corner;
out vec2 spot;
void main() {
  spot = middle + 16.0 * corner;
  gl_Position = clip * vec4(spot, 0.0, 1.0);
}`;
const FLOOR_FRAGMENT = `#version 300 es
precision highp float;
uniform vec3 sky;
uniform vec2 middle;
in vec2 spot;
out vec4 colour;
float lines(float cell) {
  vec2 at = abs(fract(spot / cell - 0.5) - 0.5) * cell, width = fwidth(spot);
  vec2 on = 1.0 - smoothstep(vec2(0.004), 0.004 + 1.5 * width, at);
  return max(on.x, on.y);
}
void main() {
  vec3 plane = mix(mix(vec3(0.9, 0.91, 0.935), vec3(0.8, 0.82, 0.85), lines(0.5)), vec3(0.68, 0.71, 0.76), lines(1.0) * 0.8);
  colour = vec4(mix(plane, sky, smoothstep(4.0, 15.0, distance(spot, middle))), 1.0);
}`;
const BOARD_VERTEX = `#version 300 es
uniform mat4 clip;
uniform vec2 size;
layout(location = 0) in vec2 corner;
out vec2 spot;
void main() {
  spot = vec2(0.5 + 0.5 * corner.x, 0.5 - 0.5 * corner.y);
  gl_Position = clip * vec4(0.5 * size * corner, 0.0, 1.0);
}`;
const BOARD_FRAGMENT = `#version 300 es
precision mediump float;
uniform sampler2D picture;
in vec2 spot;
out vec4 colour;
void main() { colour = texture(picture, spot); }`;
const DOT_VERTEX = `#version 300 es
uniform mat4 clip;
uniform float size;
layout(location = 0) in vec3 position;
void main() {
  gl_Position = clip * vec4(position, 1.0);
  gl_PointSize = size / gl_Position.w;
}`;
const DOT_FRAGMENT = `#version 300 es
precision mediump float;
out vec4 colour;
void main() {
  vec2 at = 2.0 * gl_PointCoord - 1.0;
  if (dot(at, at) > 1.0) discard;
  colour = vec4(mix(vec3(0.36, 0.56, 0.9), vec3(0.13, 0.3, 0.66), dot(at, at)), 1.0);
}`;

export class Painter {
  #gl;
  #programs;
  #meshes;
  #square;
  #dots;
  #picture = null;

  // gl: a WebGL2 context; meshes: from fetchMeshes().
  constructor(gl, meshes) {
    this.#gl = gl;
    this.#programs = {
      body: program(gl, BODY_VERTEX, BODY_FRAGMENT),
      floor: program(gl, FLOOR_VERTEX, FLOOR_FRAGMENT),
      board: program(gl, BOARD_VERTEX, BOARD_FRAGMENT),
      dots: program(gl, DOT_VERTEX, DOT_FRAGMENT),
    };
    this.#meshes = meshes.map((mesh) => ({ ...mesh, ...upload(gl, mesh) }));
    this.#square = square(gl);
    this.#dots = { array: gl.createVertexArray(), buffer: gl.createBuffer() };
  }

  clear() {
    const gl = this.#gl;
    gl.clearColor(...SKY, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  }

  // One eye's picture.
  //   projection, eyeFromWorld: matrices; viewport: {x, y, width, height}
  //   poses: of all bodies (kinematics.js); hidden: indices of bodies that are not drawn
  draw(projection, eyeFromWorld, { x, y, width, height }, poses, hidden) {
    const gl = this.#gl, clip = multiply(projection, eyeFromWorld), [mx, my] = poses[0].position;
    gl.viewport(x, y, width, height);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.CULL_FACE);
    const { floor, body } = this.#programs;
    gl.useProgram(floor.program);
    gl.uniformMatrix4fv(floor.at.clip, false, clip);
    gl.uniform3fv(floor.at.sky, SKY);
    gl.uniform2f(floor.at.middle, mx, my);
    gl.disable(gl.CULL_FACE);
    gl.bindVertexArray(this.#square);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    gl.useProgram(body.program);
    gl.uniform3fv(body.at.sun, unit(SUN));
    const flat = [1, 0, 0, 0, 0, 1, 0, 0, -SUN[0] / SUN[2], -SUN[1] / SUN[2], 0, 0, 0, 0, 0.002, 1];
    for (const [shadow, view] of [[true, multiply(clip, flat)], [false, clip]]) {
      gl.uniformMatrix4fv(body.at.clip, false, view);
      gl.uniform1i(body.at.shadow, shadow);
      shadow ? gl.disable(gl.CULL_FACE) : gl.enable(gl.CULL_FACE);
      for (const mesh of this.#meshes) {
        if (hidden?.has(mesh.body)) continue;
        const { position, quaternion } = poses[mesh.body];
        gl.uniformMatrix4fv(body.at.model, false, fromPose(position, quaternion));
        gl.uniform3fv(body.at.rgb, shadow ? SHADOW : mesh.rgb.map((value) => value / 255 + 0.03));
        gl.bindVertexArray(mesh.array);
        gl.drawElements(gl.TRIANGLES, mesh.count, gl.UNSIGNED_INT, 0);
      }
    }
    gl.bindVertexArray(null);
  }

  // A board of buttons in front of everything in its place. canvas: its picture; changed: whether it was painted anew.
  drawBoard(projection, eyeFromBoard, size, canvas, changed) {
    const gl = this.#gl, { program: code, at } = this.#programs.board;
    if (!this.#picture || changed) this.#paint(canvas);
    gl.useProgram(code);
    gl.disable(gl.CULL_FACE);
    gl.uniformMatrix4fv(at.clip, false, multiply(projection, eyeFromBoard));
    gl.uniform2fv(at.size, size);
    gl.bindTexture(gl.TEXTURE_2D, this.#picture);
    gl.bindVertexArray(this.#square);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    gl.bindVertexArray(null);
  }

  // The person's own hands, which no headset shows: discs at these points of its space, of this radius [m].
  drawDots(projection, eyeFromSpace, { height }, points, radius) {
    if (!points.length) return;
    const gl = this.#gl, { program: code, at } = this.#programs.dots, { array, buffer } = this.#dots;
    gl.useProgram(code);
    gl.uniformMatrix4fv(at.clip, false, multiply(projection, eyeFromSpace));
    gl.uniform1f(at.size, height * projection[5] * radius);
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(points.flat()), gl.STREAM_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.drawArrays(gl.POINTS, 0, points.length);
    gl.bindVertexArray(null);
  }

  #paint(canvas) {
    const gl = this.#gl;
    this.#picture ??= gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.#picture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, canvas);
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
  }
}

// What the robot looks like: [{body, rgb, positions, normals, faces}, ...]. The layout stands in app/outputs/meshes.py.
export async function fetchMeshes() {
  const data = await (await fetch("/api/scene/meshes")).arrayBuffer();
  const length = new DataView(data).getUint32(0, true);
  let at = 4 + length;
  return JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length))).map(({ body, rgb, vertices, faces }) => {
    const positions = new Float32Array(data, at, 3 * vertices), indices = new Uint32Array(data, at + 12 * vertices, 3 * faces);
    at += 12 * (vertices + faces);
    return { body, rgb, positions, normals: normals(positions, indices), faces: indices };
  });
}

// Of every vertex the mean of its faces' normals; sharp edges have their vertices twice.
function normals(p, faces) {
  const sums = new Float32Array(p.length);
  for (let f = 0; f < faces.length; f += 3) {
    const [a, b, c] = [3 * faces[f], 3 * faces[f + 1], 3 * faces[f + 2]];
    const ux = p[b] - p[a], uy = p[b + 1] - p[a + 1], uz = p[b + 2] - p[a + 2];
    const vx = p[c] - p[a], vy = p[c + 1] - p[a + 1], vz = p[c + 2] - p[a + 2];
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    for (const v of [a, b, c]) (sums[v] += x), (sums[v + 1] += y), (sums[v + 2] += z);
  }
  for (let v = 0; v < sums.length; v += 3) {
    const length = Math.hypot(sums[v], sums[v + 1], sums[v + 2]) || 1;
    for (let i = v; i < v + 3; i++) sums[i] /= length;
  }
  return sums;
}

function unit(v) {
  const length = Math.hypot(...v);
  return v.map((x) => x / length);
}

function upload(gl, { positions, normals: directions, faces }) {
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  [positions, directions].forEach((numbers, location) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(location);
    gl.vertexAttribPointer(location, 3, gl.FLOAT, false, 0, 0);
  });
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.STATIC_DRAW);
  gl.bindVertexArray(null);
  return { array, count: faces.length };
}

function square(gl) {
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]), gl.STATIC_DRAW);
  gl.enableVertexAttribArray(0);
  gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
  gl.bindVertexArray(null);
  return array;
}

function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  const at = {};
  for (let i = 0; i < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); i++) {
    const { name } = gl.getActiveUniform(made, i);
    at[name] = gl.getUniformLocation(made, name);
  }
  return { program: made, at };
}
