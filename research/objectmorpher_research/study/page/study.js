"use strict";
// One page of a study after the other. The server knows which method made what; this page does not.

const QUESTIONS = [
  ["Guidance", "How well does the result do what is asked?", "not at all", "exactly"],
  ["Realism and style", "How real does it look, and does it suit the original?", "fake", "real"],
  ["Identity", "Is it still the same object?", "another one", "the same"],
];
const SVG = "http://www.w3.org/2000/svg";
const $ = (id) => document.getElementById(id);
const KEPT = "objectmorpher-study";

let state = null; // what the server has told
let at = 0; // the page
let marks = []; // of this page, null where none is given
let seen = 0; // ms that this page has been in view
let since = null; // when it last came into view
let isSending = false;
let retry = null;
const missed = new Set(); // names of pictures that could not be loaded
let renewed = null; // the page for which pictures' names were asked for again

// ---- talking to the server

async function ask(path, body) {
  const answer = await fetch(path, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body),
  });
  const told = await answer.json();
  if (!answer.ok) throw Object.assign(new Error(told.error), { status: answer.status });
  return told;
}

async function trying(work) {
  $("trouble").hidden = true;
  try {
    await work();
  } catch (error) {
    const isLost = error.status === undefined;
    complain(isLost ? "The study cannot be reached. Your answers so far are kept." : error.message, work);
  }
}

function complain(sentence, work) {
  retry = work;
  $("trouble").firstElementChild.textContent = sentence;
  $("trouble").hidden = false;
}

// ---- what is kept in this browser: the key, and marks that are not sent yet

function kept() {
  try { return JSON.parse(localStorage.getItem(KEPT)) || {}; } catch { return {}; }
}

function keep(values) {
  try { localStorage.setItem(KEPT, JSON.stringify({ ...kept(), ...values })); } catch { /* full, or forbidden */ }
}

// ---- pages

function show(name) {
  for (const id of ["welcome", "study", "thanks"]) $(id).hidden = id !== name;
}

async function start() {
  const about = await ask("api/about", {});
  $("consent").textContent = about.consent;
  $("count").textContent = about.results;
  $("minutes").textContent = about.minutes;
  const { key, study } = kept();
  if (key && study === about.study) {
    try {
      state = await ask("api/state", { key });
      return resume();
    } catch (error) {
      if (error.status !== 404) throw error;
    }
  }
  show("welcome");
}

async function begin() {
  const joined = await ask("api/begin", { agreed: $("agreed").checked });
  keep({ key: joined.key, study: joined.study, draft: null });
  state = joined;
  resume();
}

function resume() {
  const open = state.items.findIndex((_, k) => !(k in state.answers));
  if (open < 0) return thank();
  show("study");
  turnTo(open);
}

function thank() {
  $("number").textContent = state.number;
  show("thanks");
}

function turnTo(k) {
  at = k;
  const item = state.items[k];
  const draft = kept().draft;
  marks = state.answers[k] || (draft && draft.item === k ? draft.marks : null) || [null, null, null];
  marks = [...marks];
  seen = draft && draft.item === k ? draft.seen || 0 : 0;
  since = document.hidden ? null : performance.now();
  const total = state.items.length;
  $("where").textContent = `${k + 1} of ${total}`;
  $("bar").firstElementChild.style.width = `${(100 * k) / total}%`;
  $("bar").setAttribute("aria-valuemax", total);
  $("bar").setAttribute("aria-valuenow", k);
  const isCheck = Boolean(item.asked);
  $("pictures").hidden = isCheck;
  $("check").hidden = !isCheck;
  compare(false);
  if (isCheck) {
    $("asked").replaceChildren(...item.asked.map((mark, q) => {
      const line = document.createElement("li");
      line.append(Object.assign(document.createElement("span"), { textContent: QUESTIONS[q][0] }));
      line.append(Object.assign(document.createElement("strong"), { textContent: mark }));
      return line;
    }));
  } else {
    const { words, picture, arrows } = item.guidance;
    $("words").textContent = words || (arrows.length ? "Move each dot to the tip of its arrow." : "");
    $("guide").hidden = !picture;
    draw($("original"), item.original, item.size, arrows);
    if (picture) draw($("guidance"), picture, item.guidance.size, []);
    draw($("result"), item.result, item.size, []);
  }
  $("back").disabled = k === 0;
  $("next").textContent = k === total - 1 ? "Finish" : "Next";
  fill();
  focusOn(Math.max(marks.indexOf(null), 0));
  preload(k + 1);
}

function preload(k) {
  const item = state.items[k];
  if (item && item.result) new Image().src = item.result;
}

// A server that was started anew gives other names to the pictures.
async function renew() {
  renewed = at;
  state = await ask("api/state", { key: kept().key });
  turnTo(at);
}

function miss(image, url) {
  if (!image.isConnected || missed.has(url)) return;
  const isSecond = renewed === at;
  const { original, result, guidance } = state.items[at];
  [original, result, guidance.picture].forEach((name) => missed.add(name)); // they fail together
  if (isSecond) complain("A picture could not be loaded.", renew); else trying(renew);
}

// A picture and arrows over it in one SVG, so that both are scaled alike.
function draw(frame, url, [width, height], arrows) {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  const image = document.createElementNS(SVG, "image");
  for (const [name, value] of Object.entries({ href: url, width, height })) image.setAttribute(name, value);
  image.addEventListener("load", () => { frame.dataset.loaded = url; update(); });
  image.addEventListener("error", () => miss(image, url));
  frame.dataset.loaded = "";
  svg.append(image, ...arrows.map((arrow) => drawArrow(arrow, Math.max(width, height))));
  frame.replaceChildren(svg);
}

function drawArrow([x0, y0, x1, y1], side) {
  const group = document.createElementNS(SVG, "g");
  group.classList.add("arrow");
  const thick = side / 170;
  const length = Math.hypot(x1 - x0, y1 - y0) || 1;
  const [dx, dy] = [(x1 - x0) / length, (y1 - y0) / length];
  const head = Math.min(4.5 * thick, 0.6 * length);
  const wing = (turn) => `${x1 - head * (dx * 0.87 - turn * dy * 0.5)} ${y1 - head * (dy * 0.87 + turn * dx * 0.5)}`;
  const path = `M ${x0} ${y0} L ${x1} ${y1} M ${wing(1)} L ${x1} ${y1} L ${wing(-1)}`;
  for (const [name, width] of [["under", 2.1 * thick], ["over", thick]]) {
    const line = document.createElementNS(SVG, "path");
    line.setAttribute("class", name);
    line.setAttribute("d", path);
    line.setAttribute("stroke-width", width);
    group.append(line);
  }
  const dot = document.createElementNS(SVG, "circle");
  for (const [name, value] of Object.entries({ cx: x0, cy: y0, r: 1.7 * thick, "stroke-width": 0.6 * thick })) dot.setAttribute(name, value);
  group.append(dot);
  return group;
}

function compare(isOn) {
  const item = state.items[at];
  $("compare").setAttribute("aria-pressed", isOn);
  $("shown").textContent = isOn ? "Original" : "Result";
  const image = $("result").querySelector("image");
  if (image && item.result) image.setAttribute("href", isOn ? item.original : item.result);
}

// ---- the three questions

function build() {
  $("questions").replaceChildren(...QUESTIONS.map(([name, text, low, high], q) => {
    const field = document.createElement("fieldset");
    const legend = document.createElement("legend");
    legend.append(Object.assign(document.createElement("b"), { textContent: name }));
    legend.append(Object.assign(document.createElement("span"), { textContent: text }));
    const row = Object.assign(document.createElement("div"), { className: "marks" });
    for (let mark = 1; mark <= 5; mark++) {
      const label = document.createElement("label");
      const input = Object.assign(document.createElement("input"), { type: "radio", name: `q${q}`, value: mark });
      input.setAttribute("aria-label", mark === 1 ? `1, ${low}` : mark === 5 ? `5, ${high}` : `${mark}`);
      input.addEventListener("change", () => give(q, mark));
      input.addEventListener("focus", () => current(q));
      label.append(input, Object.assign(document.createElement("span"), { textContent: mark }));
      row.append(label);
    }
    const ends = Object.assign(document.createElement("div"), { className: "ends" });
    ends.append(...[low, high].map((end) => Object.assign(document.createElement("span"), { textContent: end })));
    field.append(legend, row, ends);
    return field;
  }));
}

function inputs(q) {
  return [...document.querySelectorAll(`input[name=q${q}]`)];
}

function current(q) {
  document.querySelectorAll("fieldset").forEach((field, k) => field.classList.toggle("current", k === q));
}

function focusOn(q) {
  const own = inputs(q);
  (own.find((input) => input.checked) || own[0]).focus({ preventScroll: true });
  current(q);
}

function give(q, mark) {
  marks[q] = mark;
  inputs(q)[mark - 1].checked = true;
  keep({ draft: { item: at, marks, seen: inView() } });
  update();
}

function fill() {
  QUESTIONS.forEach((_, q) => inputs(q).forEach((input, k) => { input.checked = marks[q] === k + 1; }));
  update();
}

function update() {
  const isLoaded = Boolean(state.items[at].asked) || Boolean($("original").dataset.loaded && $("result").dataset.loaded);
  $("next").disabled = isSending || !isLoaded || marks.includes(null);
}

function inView() {
  return seen + (since === null ? 0 : performance.now() - since);
}

async function send() {
  renewed = null;
  if ($("next").disabled) return;
  isSending = true;
  update();
  try {
    const seconds = Math.min(inView() / 1000, 3600);
    const told = await ask("api/answer", { key: kept().key, item: at, ratings: marks, seconds });
    state.answers[at] = marks;
    keep({ draft: null });
    isSending = false;
    if (told.finished) return thank();
    turnTo(Math.min(at + 1, state.items.length - 1));
  } finally {
    isSending = false;
    update();
  }
}

// ---- hands

document.addEventListener("keydown", (event) => {
  if ($("study").hidden || event.ctrlKey || event.altKey || event.metaKey) return;
  if (event.key >= "1" && event.key <= "5") {
    const q = [...document.querySelectorAll("fieldset")].findIndex((field) => field.classList.contains("current"));
    give(Math.max(q, 0), Number(event.key));
    const next = Math.min(Math.max(q, 0) + 1, QUESTIONS.length - 1);
    focusOn(next);
    event.preventDefault();
  } else if (event.key === "Enter" && event.target.tagName !== "BUTTON") {
    trying(send);
    event.preventDefault();
  } else if (event.key.toLowerCase() === "o" && !event.repeat) {
    compare(true);
  }
});
document.addEventListener("keyup", (event) => {
  if (!$("study").hidden && event.key.toLowerCase() === "o") compare(false);
});
document.addEventListener("visibilitychange", () => {
  if (document.hidden) { seen = inView(); since = null; } else { since = performance.now(); }
});
$("agreed").addEventListener("change", () => { $("begin").disabled = !$("agreed").checked; });
$("begin").addEventListener("click", () => trying(begin));
$("next").addEventListener("click", () => trying(send));
$("back").addEventListener("click", () => turnTo(at - 1));
$("compare").addEventListener("click", () => compare($("compare").getAttribute("aria-pressed") !== "true"));
$("another").addEventListener("click", () => {
  localStorage.removeItem(KEPT);
  location.reload();
});
$("trouble").querySelector("button").addEventListener("click", () => trying(retry));
build();
trying(start);
