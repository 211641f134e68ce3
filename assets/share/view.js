// The page: an object in its photo that can be dragged and turned. WebGL2 draws, arap.js deforms.
"use strict";

const GRAB = 14;          // css px within which a handle is taken
const TURN = 0.4;         // degrees per css px
const CLOSE = 1.6;        // x the Gaussians' spacing: what of the object is under the pointer
const SLOPES = 3;
const ANCHORED = 0.93;    // x the largest distance along the surface: what a single handle leaves

const say = (text) => { document.getElementById("hint").textContent = text; };

// ---- data ----------------------------------------------------------------------------------

function unpack() {
  const about = JSON.parse(document.getElementById("about").textContent);
  const text = atob(document.getElementById("data").textContent.trim());
  const bytes = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
  const kinds = { f4: Float32Array, u4: Uint32Array, u2: Uint16Array, i2: Int16Array,
    u1: Uint8Array, i1: Int8Array };
  const arrays = {};
  for (const [name, { at, kind, length }] of Object.entries(about.arrays))
    arrays[name] = new kinds[kind](bytes.buffer, at, length);
  return { ...about, arrays };
}

const picture = (id) => document.getElementById(id).decode().then(() => document.getElementById(id));

// ---- small matrices, row by row ---------------------------------------------------------------

const product = (a, b) => [0, 1, 2].flatMap((r) => [0, 1, 2].map(
  (c) => a[3 * r] * b[c] + a[3 * r + 1] * b[3 + c] + a[3 * r + 2] * b[6 + c]));
const times = (m, v) => [0, 1, 2].map((r) => m[3 * r] * v[0] + m[3 * r + 1] * v[1] + m[3 * r + 2] * v[2]);
const plus = (a, b) => a.map((v, k) => v + b[k]);
const minus = (a, b) => a.map((v, k) => v - b[k]);
const transposed = (m) => [m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]];

function inverse(m) {
  const [a, b, c, d, e, f, g, h, i] = m;
  const det = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
  return [e * i - f * h, c * h - b * i, b * f - c * e, f * g - d * i, a * i - c * g,
    c * d - a * f, d * h - e * g, b * g - a * h, a * e - b * d].map((v) => v / det);
}

function rotation([x, y, z], degrees) {  // about a direction of the length 1
  const t = degrees * Math.PI / 180, c = Math.cos(t), s = Math.sin(t), d = 1 - c;
  return [c + d * x * x, d * x * y - s * z, d * x * z + s * y,
    d * x * y + s * z, c + d * y * y, d * y * z - s * x,
    d * x * z - s * y, d * y * z + s * x, c + d * z * z];
}

function matrixOf(q, at) {  // wxyz
  const [w, x, y, z] = [q[at], q[at + 1], q[at + 2], q[at + 3]];
  return [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
    2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
    2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)];
}

// ---- the object -------------------------------------------------------------------------------

class Thing {
  constructor(data) {
    this.data = data;
    this.count = data.arrays.means.length / 3;
    this.nodes = data.arrays.rest.length / 3;
    this.reset();
  }

  reset() {
    this.points = Float32Array.from(this.data.arrays.points);
    this.quats = Float32Array.from(this.data.arrays.quats);
    this.turn = [...this.data.turn];
    this.shift = [...this.data.shift];
    this.handles = [];
  }

  // A rest point of the surface, bound as Gaussian `g` is, in the world.
  world(point, g) {
    const { nodes, shares, rest } = this.data.arrays;
    let at = [0, 0, 0];
    for (let b = 0; b < 4; b++) {
      const n = nodes[4 * g + b], share = shares[4 * g + b] / 65535;
      const local = minus(point, rest.subarray(3 * n, 3 * n + 3));
      const moved = plus(times(matrixOf(this.quats, 4 * n), local), this.points.subarray(3 * n, 3 * n + 3));
      at = plus(at, moved.map((v) => v * share));
    }
    return plus(times(this.turn, at), this.shift);
  }

  projected([x, y, z]) {
    const [focal, cx, cy] = this.data.camera;
    return [focal * x / z + cx, focal * y / z + cy];
  }

  // Object-frame place of photo px at a depth.
  place([u, v], depth) {
    const [focal, cx, cy] = this.data.camera;
    const world = [(u - cx) / focal * depth, (v - cy) / focal * depth, depth];
    return times(inverse(this.turn), minus(world, this.shift));
  }

  // The nearest Gaussian of the surface that is seen at photo px, or null beside the object.
  pick(xy) {
    const { means, seen } = this.data.arrays;
    const near = [];
    for (let g = 0; g < this.count; g++) {
      if (seen[2 * g + 1] < 128) continue;  // of the soft edge
      const world = this.world(means.subarray(3 * g, 3 * g + 3), g);
      const px = this.projected(world), far = Math.hypot(px[0] - xy[0], px[1] - xy[1]);
      const reach = CLOSE * this.data.gap / 5 * this.data.camera[0] / world[2];
      if (far < reach) near.push({ g, depth: world[2], far, px });
    }
    if (!near.length) return null;
    const front = Math.min(...near.map((n) => n.depth));
    const shown = near.filter((n) => n.depth < front + this.data.gap);
    return shown.reduce((a, b) => (a.far <= b.far ? a : b));
  }

  // Turns the whole object about its centre: by yaw about its own upright, by pitch about the camera's x axis.
  rotate(yaw, pitch) {
    const centre = plus(times(this.turn, this.data.middle), this.shift);
    const down = times(this.turn, this.data.down), length = Math.hypot(...down);
    const by = product(rotation([1, 0, 0], pitch), rotation(down.map((v) => v / length), yaw));
    this.turn = product(by, this.turn);
    this.shift = plus(centre, times(by, minus(this.shift, centre)));
  }

  // Towards the camera or away from it, on the ray through its centre.
  push(factor) {
    const centre = plus(times(this.turn, this.data.middle), this.shift);
    const wanted = Math.min(Math.max(centre[2] * factor, 0.3 * this.data.depth), 4 * this.data.depth);
    this.shift = plus(this.shift, centre.map((v) => v * (wanted / centre[2] - 1)));
  }
}

// ---- drawing ----------------------------------------------------------------------------------

class Painter {
  constructor(canvas, data, pictures) {
    const gl = canvas.getContext("webgl2", { antialias: false, preserveDrawingBuffer: true });
    if (!gl || !gl.getExtension("EXT_color_buffer_float")) throw new Error("WebGL 2 is not available");
    const isWide = gl.getExtension("EXT_float_blend") !== null;
    Object.assign(this, { gl, canvas, data, sums: isWide ? gl.RGBA32F : gl.RGBA16F });
    const source = (id) => document.getElementById(id).textContent.trim();
    const front = source("splat-frag").replace("#version 300 es", "#version 300 es\n#define FRONT");
    this.frontProgram = this.program(source("splat-vert"), front);
    this.sumProgram = this.program(source("splat-vert"), source("splat-frag"));
    const all = "#version 300 es\nvoid main() { vec2 p = vec2(gl_VertexID & 1, gl_VertexID >> 1);"
      + " gl_Position = vec4(4.0 * p - 1.0, 0.0, 1.0); }";
    this.resolveProgram = this.program(all, source("resolve-frag"));
    this.array = this.instances();
    this.empty = gl.createVertexArray();
    [this.foreground, this.matte, this.plate] = pictures.map((p) => this.texture(p));
    this.bones = this.plain(gl.TEXTURE_2D, gl.NEAREST);
    this.size = [0, 0];
  }

  program(vertex, fragment) {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS))
        throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const places = {};
    for (let k = 0; k < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); k++) {
      const { name } = gl.getActiveUniform(program, k);
      places[name] = gl.getUniformLocation(program, name);
    }
    return { program, places };
  }

  instances() {
    const gl = this.gl, a = this.data.arrays, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    const add = (index, values, size, type, isNormal, stride, offset) => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(index);
      if (isNormal === null) gl.vertexAttribIPointer(index, size, type, stride, offset);
      else gl.vertexAttribPointer(index, size, type, isNormal, stride, offset);
      gl.vertexAttribDivisor(index, 1);
    };
    add(0, a.means, 3, gl.FLOAT, false, 0, 0);
    add(1, a.covs, 3, gl.FLOAT, false, 24, 0);
    add(2, a.covs, 3, gl.FLOAT, false, 24, 12);
    add(3, a.u0, 2, gl.FLOAT, false, 0, 0);
    add(4, a.seen, 2, gl.UNSIGNED_BYTE, true, 0, 0);
    add(5, a.colors, 4, gl.UNSIGNED_BYTE, true, 0, 0);
    add(6, a.normals, 3, gl.SHORT, true, 0, 0);
    add(7, a.nodes, 4, gl.UNSIGNED_SHORT, null, 0, 0);
    add(8, a.shares, 4, gl.UNSIGNED_SHORT, true, 0, 0);
    for (let b = 0; b < 4; b++) add(9 + b, a.slopes, SLOPES, gl.SHORT, true, 24, 6 * b);
    gl.bindVertexArray(null);
    return array;
  }

  plain(target, filter) {
    const gl = this.gl, texture = gl.createTexture();
    gl.bindTexture(target, texture);
    for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
      gl.texParameteri(target, side, filter);
    for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T])
      gl.texParameteri(target, side, gl.CLAMP_TO_EDGE);
    return texture;
  }

  texture(image) {
    const gl = this.gl, texture = this.plain(gl.TEXTURE_2D, gl.LINEAR);
    gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, image);
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    return texture;
  }

  resize(width, height) {
    if (this.size[0] === width && this.size[1] === height) return;
    const gl = this.gl;
    this.size = [width, height];
    [this.canvas.width, this.canvas.height] = this.size;
    const target = (format) => {
      const texture = this.plain(gl.TEXTURE_2D, gl.NEAREST);
      gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
      return texture;
    };
    for (const layer of this.layers || []) {
      [layer.depth, layer.sum, layer.total].forEach((t) => gl.deleteTexture(t));
      [layer.frontBuffer, layer.sumBuffer].forEach((b) => gl.deleteFramebuffer(b));
    }
    this.layers = [0, 1].map(() => {
      const layer = { depth: target(gl.DEPTH_COMPONENT32F), sum: target(this.sums), total: target(this.sums) };
      layer.frontBuffer = gl.createFramebuffer();
      gl.bindFramebuffer(gl.FRAMEBUFFER, layer.frontBuffer);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, layer.depth, 0);
      layer.sumBuffer = gl.createFramebuffer();
      gl.bindFramebuffer(gl.FRAMEBUFFER, layer.sumBuffer);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, layer.sum, 0);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT1, gl.TEXTURE_2D, layer.total, 0);
      gl.drawBuffers([gl.COLOR_ATTACHMENT0, gl.COLOR_ATTACHMENT1]);
      return layer;
    });
  }

  draw(thing) {
    const gl = this.gl, data = this.data, [width, height] = this.size;
    this.uploadBones(thing);
    gl.viewport(0, 0, width, height);
    const middle = plus(times(thing.turn, data.middle), thing.shift)[2], reach = 2.5 * data.extent;
    const values = {
      bones: 2, steep: data.steep, turn: thing.turn, shift: thing.shift, rest_turn: data.rest_turn,
      rest_shift: data.rest_shift, camera: data.camera, size: data.size,
      scale: width / data.size[0], is_surface: data.is_surface, is_edged: data.is_edged,
      foreground: 0, matte: 1, before: 3, front: 4, crop: data.crop,
      range: [middle - reach, 1 / (2 * reach)], gap: data.gap, height,
    };
    [this.foreground, this.matte, this.bones].forEach((t, k) => this.bind(k, t));
    gl.bindVertexArray(this.array);
    this.layers.forEach((layer, k) => {
      this.bind(3, k ? this.layers[0].depth : null);
      this.bind(4, null);
      gl.bindFramebuffer(gl.FRAMEBUFFER, layer.frontBuffer);
      gl.enable(gl.DEPTH_TEST);
      gl.disable(gl.BLEND);
      gl.clearDepth(1);
      gl.clear(gl.DEPTH_BUFFER_BIT);
      this.splats(this.frontProgram, { ...values, is_first: k === 0 });
      gl.bindFramebuffer(gl.FRAMEBUFFER, layer.sumBuffer);
      this.bind(4, layer.depth);
      gl.disable(gl.DEPTH_TEST);
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.ONE, gl.ONE);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT);
      this.splats(this.sumProgram, { ...values, is_first: k === 0 });
    });
    this.resolve();
  }

  splats(program, values) {
    this.use(program, values);
    this.gl.drawArraysInstanced(this.gl.TRIANGLE_STRIP, 0, 4, this.data.arrays.means.length / 3);
  }

  resolve() {
    const gl = this.gl, [one, two] = this.layers;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.disable(gl.BLEND);
    gl.bindVertexArray(this.empty);
    [one.sum, one.total, two.sum, two.total, this.plate].forEach((t, k) => this.bind(k, t));
    this.use(this.resolveProgram, { sum0: 0, total0: 1, sum1: 2, total1: 3, plate: 4, canvas: this.size });
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  use({ program, places }, values) {
    const gl = this.gl;
    gl.useProgram(program);
    for (const [name, place] of Object.entries(places)) {
      const value = values[name];
      if (INTEGERS.has(name)) gl.uniform1i(place, value);
      else if (!Array.isArray(value)) gl.uniform1f(place, value);
      else if (value.length === 9) gl.uniformMatrix3fv(place, true, value);
      else gl[`uniform${value.length}fv`](place, value);
    }
  }

  bind(unit, texture) {
    this.gl.activeTexture(this.gl.TEXTURE0 + unit);
    this.gl.bindTexture(this.gl.TEXTURE_2D, texture);
  }

  uploadBones(thing) {
    const gl = this.gl, n = thing.nodes, rows = new Float32Array(12 * n), rest = this.data.arrays.rest;
    for (let i = 0; i < n; i++) {
      rows.set(thing.points.subarray(3 * i, 3 * i + 3), 4 * i);
      const [w, x, y, z] = thing.quats.subarray(4 * i, 4 * i + 4);
      rows.set([x, y, z, w], 4 * (n + i));
      rows.set(rest.subarray(3 * i, 3 * i + 3), 4 * (2 * n + i));
    }
    this.bind(2, this.bones);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, n, 3, 0, gl.RGBA, gl.FLOAT, rows);
  }
}

const INTEGERS = new Set(["bones", "foreground", "matte", "before", "front", "sum0", "total0", "sum1",
  "total1", "plate", "is_surface", "is_edged", "is_first"]);

// ---- the hand ---------------------------------------------------------------------------------

class Hand {
  constructor(thing, worker, shade) {
    Object.assign(this, { thing, worker, shade, stroke: null, pointers: new Map() });
    this.isAsked = false;
    const stage = document.getElementById("stage");
    stage.addEventListener("pointerdown", (e) => this.begin(e));
    stage.addEventListener("pointermove", (e) => this.go(e));
    for (const name of ["pointerup", "pointercancel"]) stage.addEventListener(name, (e) => this.end(e));
    stage.addEventListener("dblclick", (e) => this.release(e));
    stage.addEventListener("wheel", (e) => this.wheel(e), { passive: false });
    window.addEventListener("keydown", (e) => { if (e.key === "Escape" || e.key === "r") this.reset(); });
    document.getElementById("reset").addEventListener("click", () => this.reset());
    const before = document.getElementById("before");
    for (const [name, is] of [["pointerdown", true], ["pointerup", false], ["pointerleave", false]])
      before.addEventListener(name, () => { this.shade(is); });
  }

  // Photo px under an event.
  at(event) {
    const box = document.getElementById("canvas").getBoundingClientRect(), [w, h] = this.thing.data.size;
    return [(event.clientX - box.left) / box.width * w, (event.clientY - box.top) / box.height * h];
  }

  get perPx() {
    return this.thing.data.size[0] / document.getElementById("canvas").getBoundingClientRect().width;
  }

  nearest(xy) {
    const found = this.thing.handles.map((h) => ({ h, far: Math.hypot(...minus(this.thing.projected(this.thing.world(h.point, h.g)), xy)) }))
      .sort((a, b) => a.far - b.far)[0];
    return found && found.far < GRAB * this.perPx ? found.h : null;
  }

  begin(event) {
    event.target.setPointerCapture?.(event.pointerId);
    this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
    if (this.pointers.size > 1) { this.stroke = { kind: "turn" }; return; }
    const xy = this.at(event);
    let handle = event.button === 0 && !event.shiftKey ? this.nearest(xy) : null;
    if (!handle && event.button === 0 && !event.shiftKey) {
      const hit = this.thing.pick(xy);
      if (hit) handle = this.add(hit);
    }
    if (!handle) { this.stroke = { kind: "turn" }; return; }
    const px = this.thing.projected(this.thing.world(handle.point, handle.g));
    handle.grabbed = px;
    this.stroke = { kind: "drag", handle, offset: minus(px, xy),
      depth: this.thing.world(handle.point, handle.g)[2] };
  }

  add(hit) {
    const { means, nodes, shares } = this.thing.data.arrays, g = hit.g;
    const handle = {
      g, point: [...means.subarray(3 * g, 3 * g + 3)], nodes: [...nodes.subarray(4 * g, 4 * g + 4)],
      shares: [...shares.subarray(4 * g, 4 * g + 4)].map((s) => s / 65535),
    };
    handle.target = this.thing.place(hit.px, this.thing.world(handle.point, g)[2]);
    this.thing.handles.push(handle);
    this.hold();
    return handle;
  }

  // Tells the worker what is held; a single handle leaves the far end where it is.
  hold() {
    const { thing } = this, only = thing.handles.length === 1 ? thing.handles[0] : null;
    const anchors = [];
    if (only) {
      const far = this.distances(only.nodes[0]), most = Math.max(...far.filter(Number.isFinite));
      far.forEach((d, node) => {
        if (Number.isFinite(d) && d >= ANCHORED * most)
          anchors.push({ node, share: 1, place: [...thing.points.subarray(3 * node, 3 * node + 3)] });
      });
    }
    const handles = thing.handles.map(({ nodes, shares, point }) => ({ nodes, shares, point }));
    this.ask({ handles, anchors, targets: this.targets });
  }

  // A question that the worker answers, again and again until nothing moves.
  ask(message) {
    this.isAsked = this.thing.handles.length > 0;
    this.worker.postMessage(message);
  }

  get targets() { return this.thing.handles.flatMap((h) => h.target); }

  // Along the links, object units.
  distances(from) {
    const { starts, columns, rest } = this.thing.data.arrays, far = new Array(this.thing.nodes).fill(Infinity);
    const waiting = new Set([from]);
    far[from] = 0;
    while (waiting.size) {
      let best = -1;
      for (const n of waiting) if (best < 0 || far[n] < far[best]) best = n;
      waiting.delete(best);
      for (let k = starts[best]; k < starts[best + 1]; k++) {
        const j = columns[k];
        const way = far[best] + Math.hypot(...minus(rest.subarray(3 * best, 3 * best + 3), rest.subarray(3 * j, 3 * j + 3)));
        if (way < far[j] - 1e-9) { far[j] = way; waiting.add(j); }
      }
    }
    return far;
  }

  go(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return this.hover(event);
    this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
    if (!this.stroke) return;
    if (this.stroke.kind === "turn") {
      const share = 1 / this.pointers.size;
      this.thing.rotate(-(event.clientX - before[0]) * TURN * share, (event.clientY - before[1]) * TURN * share);
      this.changed();
      return;
    }
    const { handle, offset, depth } = this.stroke;
    handle.target = this.thing.place(plus(this.at(event), offset), depth);
    this.ask({ targets: this.targets });
  }

  hover(event) {
    const xy = this.at(event);
    document.getElementById("stage").style.cursor = this.nearest(xy) ? "grab" : "";
  }

  end(event) {
    this.pointers.delete(event.pointerId);
    if (!this.pointers.size) this.stroke = null;
  }

  release(event) {
    const handle = this.nearest(this.at(event));
    if (!handle) return;
    this.thing.handles = this.thing.handles.filter((h) => h !== handle);
    this.hold();
    this.changed();
  }

  wheel(event) {
    event.preventDefault();
    this.thing.push(Math.exp(event.deltaY * 0.0006));
    this.changed();
  }

  reset() {
    this.thing.reset();
    this.ask({ reset: { points: this.thing.points, quats: this.thing.quats },
      handles: [], anchors: [], targets: [] });
    this.changed();
  }
}

// ---- all together -----------------------------------------------------------------------------

async function main() {
  const data = unpack();
  const pictures = await Promise.all(["foreground", "matte", "plate"].map(picture));
  const canvas = document.getElementById("canvas"), painter = new Painter(canvas, data, pictures);
  const thing = new Thing(data), original = new Thing(data);
  original.points = data.arrays.rest;
  original.quats = Float32Array.from({ length: 4 * thing.nodes }, (_, k) => (k % 4 ? 0 : 1));
  [original.turn, original.shift] = [data.rest_turn, data.rest_shift];
  const source = document.getElementById("worker").textContent;
  const worker = new Worker(URL.createObjectURL(new Blob([source], { type: "text/javascript" })));
  const a = data.arrays;
  worker.postMessage({ rest: a.rest, starts: a.starts, columns: a.columns, weights: a.weights,
    points: a.points, quats: a.quats });
  let isDue = true, isBefore = false;
  const hand = new Hand(thing, worker, (is) => { isBefore = is; isDue = true; });
  hand.changed = () => { isDue = true; };
  const state = { thing, get isStill() { return !isDue && !hand.isAsked; } };
  worker.onmessage = ({ data: found }) => {
    if (!thing.handles.length) return;
    thing.points = found.points;
    thing.quats = found.quats;
    hand.isAsked = found.isMoving;
    isDue = true;
  };
  const marks = document.getElementById("marks");
  const fit = () => {
    const box = canvas.getBoundingClientRect(), wanted = Math.round(box.width * devicePixelRatio);
    const width = Math.max(Math.min(wanted, data.size[0], 2048), 16);
    painter.resize(width, Math.round(width * data.size[1] / data.size[0]));
    isDue = true;
  };
  new ResizeObserver(fit).observe(canvas);
  fit();
  const frame = () => {
    if (isDue) {
      isDue = false;
      painter.draw(isBefore ? original : thing);
      mark(marks, thing, isBefore);
    }
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
  document.body.classList.add("ready");
  window.objectmorpher = state;
}

function mark(marks, thing, isHidden) {
  const [width, height] = thing.data.size;
  marks.replaceChildren(...(isHidden ? [] : thing.handles).map((h) => {
    const dot = document.createElement("i"), [u, v] = thing.projected(thing.world(h.point, h.g));
    dot.style.left = `${100 * u / width}%`;
    dot.style.top = `${100 * v / height}%`;
    return dot;
  }));
}

main().catch((error) => say(`This page cannot be shown here: ${error.message}`));
