// As-rigid-as-possible deformation of the control points (Sorkine and Alexa 2007), in a worker.
//
// In: {rest, starts, columns, weights}, once; then {handles, anchors} when the set of held points
// changes, and {targets} when they move. Out: {points, quats, isMoving} after every few steps.
"use strict";

const HELD = 1e4;       // x the mean diagonal: how firmly a handle is held
const ANCHORED = 1.0;   // x the mean diagonal: the same of what stays in place
const LEAST = 1e-7;     // x the mean diagonal: a part without a handle stays where it is
const STEPS = 6;        // between two answers
const STILL = 2e-5;     // x the extent: a step that moves no point farther ends the motion
const FIT = 4;          // iterations of a rotation from where it was

let count = 0, rest, starts, columns, weights, extent;
let points, quats, laplacian, factor, meanDiagonal;
let handles = [], anchors = [], targets = [], isRunning = false;

function begin(data) {
  ({ rest, starts, columns, weights } = data);
  count = rest.length / 3;
  points = Float64Array.from(data.points);
  quats = Float64Array.from(data.quats);
  let low = [1e9, 1e9, 1e9], high = [-1e9, -1e9, -1e9];
  for (let i = 0; i < count; i++)
    for (let a = 0; a < 3; a++) {
      low[a] = Math.min(low[a], rest[3 * i + a]);
      high[a] = Math.max(high[a], rest[3 * i + a]);
    }
  extent = Math.max(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
  laplacian = new Float64Array(count * count);
  meanDiagonal = 0;
  for (let i = 0; i < count; i++)
    for (let k = starts[i]; k < starts[i + 1]; k++) {
      laplacian[i * count + columns[k]] -= weights[k];
      laplacian[i * count + i] += weights[k];
      meanDiagonal += weights[k] / count;
    }
}

// Cholesky factor of the Laplacian with what is held, rows of the lower triangle.
function factorise() {
  const n = count, l = Float64Array.from(laplacian);
  for (let i = 0; i < n; i++) l[i * n + i] += LEAST * meanDiagonal;
  for (const { nodes, shares } of handles)
    for (let a = 0; a < 4; a++)
      for (let b = 0; b < 4; b++)
        l[nodes[a] * n + nodes[b]] += HELD * meanDiagonal * shares[a] * shares[b];
  for (const { node, share } of anchors) l[node * n + node] += ANCHORED * meanDiagonal * share;
  for (let i = 0; i < n; i++) {
    for (let j = 0; j <= i; j++) {
      let sum = l[i * n + j];
      for (let k = 0; k < j; k++) sum -= l[i * n + k] * l[j * n + k];
      l[i * n + j] = i === j ? Math.sqrt(Math.max(sum, 1e-300)) : sum / l[j * n + j];
    }
  }
  factor = l;
}

// Solves for one coordinate in place.
function solve(b) {
  const n = count, l = factor;
  for (let i = 0; i < n; i++) {
    let sum = b[i];
    for (let k = 0; k < i; k++) sum -= l[i * n + k] * b[k];
    b[i] = sum / l[i * n + i];
  }
  for (let i = n - 1; i >= 0; i--) {
    b[i] /= l[i * n + i];
    const value = b[i];
    for (let k = 0; k < i; k++) b[k] -= l[i * n + k] * value;
  }
}

function matrixOf(q, at, out) {
  const w = q[at], x = q[at + 1], y = q[at + 2], z = q[at + 3];
  out[0] = 1 - 2 * (y * y + z * z); out[1] = 2 * (x * y - w * z); out[2] = 2 * (x * z + w * y);
  out[3] = 2 * (x * y + w * z); out[4] = 1 - 2 * (x * x + z * z); out[5] = 2 * (y * z - w * x);
  out[6] = 2 * (x * z - w * y); out[7] = 2 * (y * z + w * x); out[8] = 1 - 2 * (x * x + y * y);
}

// The rotation nearest to a matrix, from where it was (Mueller et al. 2016): det R = +1 always.
function fitRotation(a, at) {
  const r = new Float64Array(9);
  for (let step = 0; step < FIT; step++) {
    matrixOf(quats, at, r);
    let x = 0, y = 0, z = 0, along = 0;
    for (let c = 0; c < 3; c++) {
      x += r[3 + c] * a[6 + c] - r[6 + c] * a[3 + c];
      y += r[6 + c] * a[c] - r[c] * a[6 + c];
      z += r[c] * a[3 + c] - r[3 + c] * a[c];
      along += r[c] * a[c] + r[3 + c] * a[3 + c] + r[6 + c] * a[6 + c];
    }
    const per = 1 / (Math.abs(along) + 1e-12);
    x *= per; y *= per; z *= per;
    const angle = Math.hypot(x, y, z);
    if (angle < 1e-9) return;
    const s = Math.sin(angle / 2) / angle, c = Math.cos(angle / 2);
    multiply(c, s * x, s * y, s * z, at);
  }
}

function multiply(w, x, y, z, at) {
  const [pw, px, py, pz] = [quats[at], quats[at + 1], quats[at + 2], quats[at + 3]];
  const q = [
    w * pw - x * px - y * py - z * pz, w * px + x * pw + y * pz - z * py,
    w * py - x * pz + y * pw + z * px, w * pz + x * py - y * px + z * pw,
  ];
  const length = Math.hypot(...q);
  for (let k = 0; k < 4; k++) quats[at + k] = q[k] / length;
}

// One local and one global step; the largest way of a point.
function step() {
  const n = count, turns = new Float64Array(9 * n), a = new Float64Array(9);
  for (let i = 0; i < n; i++) {
    a.fill(0);
    for (let k = starts[i]; k < starts[i + 1]; k++) {
      const j = columns[k];
      for (let row = 0; row < 3; row++)
        for (let c = 0; c < 3; c++)
          a[3 * row + c] += weights[k] * (points[3 * j + row] - points[3 * i + row])
            * (rest[3 * j + c] - rest[3 * i + c]);
    }
    fitRotation(a, 4 * i);
    matrixOf(quats, 4 * i, turns.subarray(9 * i, 9 * i + 9));
  }
  const sides = [0, 1, 2].map(() => new Float64Array(n));
  for (let i = 0; i < n; i++)
    for (let row = 0; row < 3; row++) {
      let sum = LEAST * meanDiagonal * points[3 * i + row];
      for (let k = starts[i]; k < starts[i + 1]; k++) {
        const j = columns[k];
        for (let c = 0; c < 3; c++)
          sum += 0.5 * weights[k] * (turns[9 * i + 3 * row + c] + turns[9 * j + 3 * row + c])
            * (rest[3 * i + c] - rest[3 * j + c]);
      }
      sides[row][i] = sum;
    }
  hold(sides, turns);
  let way = 0;
  for (let row = 0; row < 3; row++) {
    solve(sides[row]);
    for (let i = 0; i < n; i++) {
      way = Math.max(way, Math.abs(sides[row][i] - points[3 * i + row]));
      points[3 * i + row] = sides[row][i];
    }
  }
  return way;
}

// What is held, on the right-hand sides: a point of the surface is where its nodes' frames put it.
function hold(sides, turns) {
  handles.forEach(({ nodes, shares, point }, h) => {
    for (let row = 0; row < 3; row++) {
      let wanted = targets[3 * h + row];
      for (let b = 0; b < 4; b++)
        for (let c = 0; c < 3; c++)
          wanted -= shares[b] * turns[9 * nodes[b] + 3 * row + c] * (point[c] - rest[3 * nodes[b] + c]);
      for (let b = 0; b < 4; b++)
        sides[row][nodes[b]] += HELD * meanDiagonal * shares[b] * wanted;
    }
  });
  for (const { node, share, place } of anchors)
    for (let row = 0; row < 3; row++)
      sides[row][node] += ANCHORED * meanDiagonal * share * place[row];
}

function run() {
  let way = 0;
  for (let k = 0; k < STEPS; k++) way = step();
  const isMoving = way > STILL * extent;
  postMessage({ points: Float32Array.from(points), quats: Float32Array.from(quats), isMoving });
  if (isMoving) setTimeout(run, 0);
  else isRunning = false;
}

onmessage = ({ data }) => {
  if (data.rest) return begin(data);
  if (data.reset) {
    points.set(data.reset.points);
    quats.set(data.reset.quats);
  }
  if (data.handles) {
    handles = data.handles;
    anchors = data.anchors;
    if (handles.length) factorise();
  }
  if (data.targets) targets = data.targets;
  if (handles.length && !isRunning) {
    isRunning = true;
    setTimeout(run, 0);
  }
};
