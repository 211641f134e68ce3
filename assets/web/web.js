// The editor in a browser: open, click, lift; the page of `share` in a frame; save.
"use strict";

const $ = (id) => document.getElementById(id);
const TINT = [255, 140, 40];   // of what is selected
const SHOWN = {
  ask: ["ask"],
  open: ["drop"],
  select: ["stage", "subject", "without", "undo", "lift", "other"],
  drag: ["frame", "back", "session", "save", "send", "other"],
};
const SENT = ["send"], KEPT = ["session", "save", "other"];  // for another program, and for oneself
const HINTS = {
  ask: "Enter the token that the server printed when it started.",
  open: "The photo is sent to the computer that serves this page, and nowhere else.",
  select: "Click the object. Shift-click, right-click or “Take away” excludes what is too much.",
  drag: "",  // the frame has a hint of its own
};
const ALL = [...new Set(Object.values(SHOWN).flat())];

let token = "", edit = null, clicks = [], isSubject = false, isWithout = false, asked = 0, stop = null;
let opening = 0;  // how often an edit was begun, or left
let pageUrl = null, most = Infinity;

// ---- the server ------------------------------------------------------------------------------

async function fetched(path, options = {}) {
  const headers = { Authorization: `Bearer ${token}`, ...options.headers };
  let answer;
  try {
    answer = await fetch(path, { ...options, headers });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Error("The server does not answer. Is it still running?");
  }
  if (answer.ok) return answer;
  if (answer.status === 401) show("ask");
  const said = await answer.json().catch(() => ({}));
  throw new Error(sentence(said.error || `the server answered ${answer.status}`));
}

// Has the server do something that takes time; shows its progress. A newer question ends it.
async function done(what, question) {
  stop?.abort();
  const own = stop = new AbortController();
  progress(0);
  try {
    const answer = await fetched(`web/edits/${edit.id}/${what}`,
      { method: "POST", body: JSON.stringify(question), signal: own.signal });
    const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
    let text = "", last = { state: "failed", error: "the server has ended" };
    for (;;) {
      const { value, done: isDone } = await reader.read();
      if (isDone) break;
      const lines = (text + value).split("\n");
      text = lines.pop();
      for (const line of lines) {
        last = JSON.parse(line);
        if (last.state === "running") { progress(last.fraction); say(last.note); }
        if (last.state === "waiting") say("Waiting for another edit on this server.");
      }
    }
    if (last.state !== "done") throw new Error(sentence(last.error || "the server has ended"));
  } finally {
    if (stop === own) { stop = null; progress(null); }
  }
}

const sentence = (text) => text[0].toUpperCase() + text.slice(1) + (/[.?!]$/.test(text) ? "" : ".");

// ---- what is shown ---------------------------------------------------------------------------

function say(text, isWrong = false) {
  $("hint").textContent = text;
  $("hint").classList.toggle("wrong", isWrong);
}

function progress(fraction) {
  $("progress").hidden = fraction === null;
  if (fraction !== null) $("progress").value = fraction;
  for (const id of ["lift", "save", "session", "send"]) $(id).disabled = fraction !== null;
  if (fraction === null) choices();
}

function choices() {
  const isChosen = edit?.isChosen === true;
  $("lift").disabled = !isChosen || stop !== null;
  $("undo").disabled = !clicks.length;
}

function show(step) {
  document.body.dataset.step = step;
  const unused = edit?.isSent ? KEPT : SENT;
  for (const id of ALL) $(id).hidden = !SHOWN[step].includes(id) || unused.includes(id);
  say(HINTS[step]);
  choices();
}

const report = (error) => { if (error.name !== "AbortError") say(error.message, true); };
const guarded = (work) => (...given) => work(...given).catch(report);

// ---- opening ---------------------------------------------------------------------------------

async function open(file, name) {
  if (file.size > most) throw new Error(`A photo may have at most ${Math.floor(most / 2 ** 20)} MB here.`);
  const own = ++opening;
  say("Opening the photo");
  const answer = await fetched("web/edits",
    { method: "POST", body: file, headers: { "X-Name": encodeURIComponent(name) } });
  await begun({ ...await answer.json(), isSent: false }, own);
}

// An edit that another program began is sent back to it. Nothing of one is shown if, meanwhile,
// another one was opened, or this one was left.
async function begun(about, own) {
  const seen = await (await fetched(`web/edits/${about.id}/photo`)).blob();
  if (own !== opening) return;
  stop?.abort();
  asked++;
  edit = { ...about, isChosen: false };
  [clicks, isSubject] = [[], false];
  sessionStorage.setItem("edit", JSON.stringify({ id: edit.id, isSent: edit.isSent }));
  URL.revokeObjectURL($("photo").src);
  $("photo").src = URL.createObjectURL(seen);
  await $("photo").decode();
  if (own !== opening) return;
  $("stage").style.setProperty("--ratio", String(edit.size[0] / edit.size[1]));
  clear();
  show("select");
}

// The edit that this tab showed before it was loaded again; false where it is not kept any more.
async function resumed() {
  const kept = JSON.parse(sessionStorage.getItem("edit") || "null");
  if (!kept) return false;
  const about = await fetched(`web/edits/${encodeURIComponent(kept.id)}/about`).catch((error) => {
    if (document.body.dataset.step === "ask") throw error;
    return null;
  });
  if (!about) { sessionStorage.removeItem("edit"); return false; }
  const told = await about.json();
  await begun({ ...told, isSent: kept.isSent }, ++opening);
  if (told.is_chosen) await shownMask(++asked);
  if (told.is_lifted) await shownObject(++asked);
  return true;
}

function leave() {
  stop?.abort();
  [opening, asked] = [opening + 1, asked + 1];
  sessionStorage.removeItem("edit");
  show("open");
  if (!$("samples").children.length) return samples();
}

function clear() {
  const canvas = $("mark");
  [canvas.width, canvas.height] = [$("photo").naturalWidth, $("photo").naturalHeight];
}

async function samples() {
  const about = await (await fetched("web/about")).json();
  most = about.most;
  $("samples").replaceChildren(...await Promise.all(about.samples.map(async (name) => {
    const blob = await (await fetched(`web/samples/${name}`)).blob();
    const button = document.createElement("button"), image = document.createElement("img");
    button.type = "button";
    image.src = URL.createObjectURL(blob);
    image.alt = name.replace(/\.\w+$/, "");
    button.append(image);
    button.addEventListener("click", guarded(() => open(blob, name)));
    return button;
  })));
}

// ---- selecting -------------------------------------------------------------------------------

async function select() {
  const number = ++asked;
  edit.isChosen = false;
  if (!clicks.length && !isSubject) { stop?.abort(); clear(); show("select"); return; }
  await done("select", {
    click: clicks.filter((c) => c.isMeant).map((c) => c.xy),
    not_click: clicks.filter((c) => !c.isMeant).map((c) => c.xy), subject: isSubject,
  });
  if (number === asked) await shownMask(number);
}

async function shownMask(number) {
  const mask = await createImageBitmap(await (await fetched(`web/edits/${edit.id}/mask`)).blob());
  if (number !== asked) return;
  edit.isChosen = true;
  mark(mask);
  choices();
  say("Click more of the object, take away what is too much, or lift it to 3D.");
}

// Tints the mask and draws its edge and the clicks.
function mark(mask) {
  clear();
  const canvas = $("mark"), pen = canvas.getContext("2d", { willReadFrequently: true });
  const { width, height } = canvas;
  pen.drawImage(mask, 0, 0, width, height);
  const pixels = pen.getImageData(0, 0, width, height), data = pixels.data;
  const isIn = Uint8Array.from({ length: width * height }, (_, k) => data[4 * k] > 127);
  for (let k = 0; k < isIn.length; k++) {
    const x = k % width;
    const isEdge = isIn[k] && (!isIn[k - width] || !isIn[k + width] || x === 0 || !isIn[k - 1]
      || x === width - 1 || !isIn[k + 1]);
    data.set([...TINT, isEdge ? 255 : isIn[k] ? 90 : 0], 4 * k);
  }
  pen.putImageData(pixels, 0, 0);
  const scale = width / edit.size[0], dot = Math.max(width, height) / 140;
  for (const { xy, isMeant } of clicks) {
    pen.beginPath();
    pen.arc(xy[0] * scale, xy[1] * scale, dot, 0, 2 * Math.PI);
    pen.fillStyle = isMeant ? "#3bb273" : "#e15554";
    pen.fill();
    pen.lineWidth = dot / 3;
    pen.strokeStyle = "#fff";
    pen.stroke();
  }
}

async function click(event) {
  event.preventDefault();
  if (document.body.dataset.step !== "select") return;
  const box = $("photo").getBoundingClientRect(), [width, height] = edit.size;
  const xy = [(event.clientX - box.left) / box.width * width, (event.clientY - box.top) / box.height * height];
  const isMeant = !(isWithout || event.shiftKey || event.type === "contextmenu");
  if (!isMeant && !edit.isChosen) { say("Click the object first."); return; }
  clicks.push({ xy, isMeant });
  without(false);
  await select();
}

function without(is) {
  isWithout = is;
  $("without").setAttribute("aria-pressed", String(is));
}

// ---- dragging and saving ---------------------------------------------------------------------

async function lift() {
  const number = ++asked;
  await done("lift", {});
  if (number === asked) await shownObject(number);
}

async function shownObject(number) {
  const page = await (await fetched(`web/edits/${edit.id}/page`)).text();
  if (number !== asked) return;
  if (pageUrl) URL.revokeObjectURL(pageUrl);
  pageUrl = URL.createObjectURL(new Blob([page], { type: "text/html" }));
  $("frame").src = pageUrl;
  show("drag");
}

function base64(floats) {
  const bytes = new Uint8Array(floats.buffer, floats.byteOffset, floats.byteLength);
  let text = "";
  for (const byte of bytes) text += String.fromCharCode(byte);
  return btoa(text);
}

async function save(what) {
  const thing = $("frame").contentWindow.objectmorpher?.thing;
  if (!thing) throw new Error("The object is not shown yet.");
  await done("render", {
    what, points: base64(thing.points), quats: base64(thing.quats), turn: thing.turn, shift: thing.shift,
  });
  if (what === "layers") {
    say("The layers are sent back. This page can be closed.");
    return;
  }
  const answer = await fetched(`web/edits/${edit.id}/files/${what}`);
  const named = answer.headers.get("Content-Disposition") || "";
  const link = document.createElement("a");
  link.download = decodeURIComponent(named.split("''")[1] || "edited.png");
  link.href = URL.createObjectURL(await answer.blob());
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
  say(`${link.download} is in your downloads.`);
}

// ---- all together ----------------------------------------------------------------------------

async function begin() {
  if (sent) {
    const about = await fetched(`web/edits/${encodeURIComponent(sent)}/about`);
    await begun({ ...await about.json(), isSent: true }, ++opening);
    return;
  }
  if (await resumed()) return;
  show("open");
  await samples();
}

$("choose").addEventListener("click", () => $("file").click());
$("file").addEventListener("change", guarded(async () => {
  const [file] = $("file").files;
  $("file").value = "";
  if (file) await open(file, file.name);
}));
$("stage").addEventListener("click", guarded(click));
$("stage").addEventListener("contextmenu", guarded(click));
$("subject").addEventListener("click", guarded(async () => { [clicks, isSubject] = [[], true]; await select(); }));
$("without").addEventListener("click", () => without(!isWithout));
$("undo").addEventListener("click", guarded(async () => { clicks.pop(); await select(); }));
$("lift").addEventListener("click", guarded(lift));
$("back").addEventListener("click", () => show("select"));
$("session").addEventListener("click", guarded(() => save("session")));
$("save").addEventListener("click", guarded(() => save("photo")));
$("send").addEventListener("click", guarded(() => save("layers")));
$("other").addEventListener("click", guarded(async () => leave()));
$("ask").addEventListener("submit", guarded(async (event) => {
  event.preventDefault();
  token = $("token").value.trim();
  sessionStorage.setItem("token", token);
  await begin();
}));
for (const name of ["dragover", "dragleave", "drop"])
  window.addEventListener(name, guarded(async (event) => {
    event.preventDefault();
    $("drop").classList.toggle("over", name === "dragover");
    const file = name === "drop" && event.dataTransfer.files[0];
    if (file && token) await open(file, file.name);
  }));

const given = new URLSearchParams(location.hash.slice(1)), sent = given.get("edit");
token = given.get("token") || sessionStorage.getItem("token") || "";
if (location.hash) {
  sessionStorage.setItem("token", token);
  history.replaceState(null, "", location.pathname);  // it is not to stand in the history
}
(token ? begin() : Promise.resolve(show("ask"))).catch(report);
