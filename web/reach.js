// How long the operator's arm is: a straight arm that swings about keeps its wrist on a sphere around the shoulder.

const STRETCH_MS = 2000; // from the button to a straight arm
const SWING_MS = 6000;
const LEAST = 40; // frames
const SPREAD = 0.15; // standard deviation of the wrist's way along its two widest directions, at least [m]
const ROUND = 0.02; // root mean square distance from the sphere, at most [m]
const BELIEVED = [0.3, 0.9]; // of an arm [m]

export class Reach {
  #points = [];

  // position: of the wrist, [x, y, z] in any fixed frame [m].
  add(position) {
    this.#points.push(position);
  }

  get count() {
    return this.#points.length;
  }

  // {arm} from shoulder to wrist [m], or {why} it cannot be told, as a sentence.
  measure() {
    const points = this.#points, n = points.length;
    if (n < LEAST) return { why: "the hands were not seen for long enough" };
    const middle = mean(points), around = points.map((p) => p.map((x, i) => x - middle[i]));
    // |p - c|² = r² is linear in c and r² - |c|²: the sphere that fits best, in least squares
    const A = Array.from({ length: 4 }, () => Array(4).fill(0)), b = Array(4).fill(0);
    for (const p of around) {
      const row = [2 * p[0], 2 * p[1], 2 * p[2], 1], square = p.reduce((sum, x) => sum + x * x, 0);
      row.forEach((v, i) => {
        b[i] += v * square;
        row.forEach((w, j) => (A[i][j] += v * w));
      });
    }
    const solved = solve(A, b);
    if (!solved || !wide(around)) return { why: "swing the arms wider, up and to the side" };
    const centre = solved.slice(0, 3), arm = Math.sqrt(solved[3] + centre.reduce((sum, x) => sum + x * x, 0));
    const off = around.map((p) => Math.hypot(...p.map((x, i) => x - centre[i])) - arm);
    if (!(Math.sqrt(mean(off.map((x) => [x * x]))[0]) < ROUND)) return { why: "keep the arms straight and the shoulders still" };
    if (!(arm > BELIEVED[0] && arm < BELIEVED[1])) return { why: "keep the arms straight and swing them wider" };
    return { arm };
  }
}

// Both arms, while they swing.
export class Swing {
  #arms = [new Reach(), new Reach()];

  constructor(now) {
    this.from = now + STRETCH_MS;
    this.until = this.from + SWING_MS;
  }

  // wrists: positions in this frame, left and right, or null. Returns null while it goes on; then {arm}, of the arms that could be
  // measured, or {why}.
  take(wrists, now) {
    if (now > this.from) wrists.forEach((wrist, side) => wrist && this.#arms[side].add(wrist));
    if (now < this.until) return null;
    const found = this.#arms.map((arm) => arm.measure()), lengths = found.map(({ arm }) => arm).filter(Boolean);
    return lengths.length ? { arm: lengths.reduce((sum, arm) => sum + arm, 0) / lengths.length } : found[0];
  }
}

const mean = (rows) => rows[0].map((_, i) => rows.reduce((sum, row) => sum + row[i], 0) / rows.length);

// Whether the points spread in two directions at least: the second largest variance is the largest of what a line leaves over.
function wide(points) {
  const C = [0, 1, 2].map((i) => [0, 1, 2].map((j) => mean(points.map((p) => [p[i] * p[j]]))[0]));
  let v = [1, 0.9, 0.8];
  for (let i = 0; i < 50; i++) {
    v = C.map((row) => row.reduce((sum, x, j) => sum + x * v[j], 0));
    v = v.map((x) => x / Math.hypot(...v));
  }
  const along = v.reduce((sum, x, i) => sum + x * C[i].reduce((s, y, j) => s + y * v[j], 0), 0);
  const rest = C[0][0] + C[1][1] + C[2][2] - along;
  return Math.sqrt(along) > SPREAD && Math.sqrt(rest) > SPREAD / 2;
}

// x of A x = b, by elimination with the largest pivot; null if there is none.
function solve(A, b) {
  const rows = A.map((row, i) => [...row, b[i]]), n = rows.length;
  for (let i = 0; i < n; i++) {
    const pivot = rows.slice(i).reduce((best, row, k) => (Math.abs(row[i]) > Math.abs(rows[best][i]) ? i + k : best), i);
    [rows[i], rows[pivot]] = [rows[pivot], rows[i]];
    if (Math.abs(rows[i][i]) < 1e-9) return null;
    for (let k = 0; k < n; k++) {
      if (k === i) continue;
      const share = rows[k][i] / rows[i][i];
      rows[k] = rows[k].map((x, j) => x - share * rows[i][j]);
    }
  }
  return rows.map((row, i) => row[n] / row[i]);
}
