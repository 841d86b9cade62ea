// Quaternions as [w, x, y, z] and vectors as [x, y, z]: plain arrays, as on the wire.

export function multiply([aw, ax, ay, az], [bw, bx, by, bz]) {
  return [
    aw * bw - ax * bx - ay * by - az * bz,
    aw * bx + ax * bw + ay * bz - az * by,
    aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw,
  ];
}

// v turned by q.
export function rotate([w, x, y, z], [vx, vy, vz]) {
  const tx = 2 * (y * vz - z * vy), ty = 2 * (z * vx - x * vz), tz = 2 * (x * vy - y * vx);
  return [vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx];
}

// The turn by an angle [rad] about a unit axis.
export function about([x, y, z], angle) {
  const s = Math.sin(angle / 2);
  return [Math.cos(angle / 2), x * s, y * s, z * s];
}

export function unit(q) {
  const length = Math.hypot(...q);
  return q.map((x) => x / length);
}

// Angle between two orientations [rad].
export function angleBetween(a, b) {
  const dot = Math.abs(a.reduce((sum, x, i) => sum + x * b[i], 0));
  return 2 * Math.acos(Math.min(1, dot));
}

export const add = ([ax, ay, az], [bx, by, bz]) => [ax + bx, ay + by, az + bz];
export const subtract = ([ax, ay, az], [bx, by, bz]) => [ax - bx, ay - by, az - bz];
export const scale = ([x, y, z], s) => [x * s, y * s, z * s];
export const distance = (a, b) => Math.hypot(...subtract(a, b));
