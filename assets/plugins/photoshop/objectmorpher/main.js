// Photoshop: sends the active layer to `objectmorpher serve --web` and brings its layers back.
"use strict";

const { app, core } = require("photoshop");
const { shell, storage } = require("uxp");

const PAUSE = 1000;  // ms between two questions whether something has come back
const GROUP = "ObjectMorpher";

const say = (text) => { document.getElementById("said").textContent = text; };

// Address and token out of the link that the server prints.
function parsed(link) {
  const [address, after = ""] = link.trim().split("#");
  const token = after.split("&").find((part) => part.startsWith("token="));
  if (!/^http:\/\/(127\.0\.0\.1|localhost):8717\/?$/.test(address) || !token)
    throw new Error("Start `objectmorpher serve --web`, and paste the link that it prints.");
  return { address: address.replace(/\/$/, ""), token: token.slice(6) };
}

async function asked({ address, token }, path, options = {}) {
  let answer;
  try {
    answer = await fetch(`${address}${path}`, {
      ...options, headers: { Authorization: `Bearer ${token}`, ...options.headers },
    });
  } catch {
    throw new Error("The server does not answer. Is `objectmorpher serve --web` still running?");
  }
  if (answer.ok || (options.isWaiting && answer.status === 404)) return answer;
  const said = await answer.json().catch(() => ({}));
  throw new Error(said.error || `The server answered ${answer.status}.`);
}

const temporary = async (name) =>
  (await storage.localFileSystem.getTemporaryFolder()).createFile(name, { overwrite: true });

// The active layer, as large as its document, as a PNG file's bytes.
async function layerFile(source, layer) {
  const file = await temporary("layer.png");
  await core.executeAsModal(async () => {
    const alone = await app.documents.add({
      width: source.width, height: source.height, resolution: source.resolution,
      mode: "RGBColorMode", fill: "transparent",
    });
    try {
      await layer.duplicate(alone);
      await alone.saveAs.png(file, {}, true);
    } finally {
      await alone.closeWithoutSaving();
    }
  }, { commandName: "Send the layer to ObjectMorpher" });
  return file.read({ format: storage.formats.binary });
}

// Puts the layers of a PSD file into a group above a layer.
async function bringBack(target, layer, data) {
  const file = await temporary("back.psd");
  await file.write(data, { format: storage.formats.binary });
  await core.executeAsModal(async () => {
    const back = await app.open(file);
    const copies = [];
    try {
      for (const each of [...back.layers].reverse()) copies.push(await each.duplicate(target));
    } finally {
      await back.closeWithoutSaving();
    }
    const group = await target.createLayerGroup({ name: GROUP, fromLayers: copies.reverse() });
    await group.move(layer, "placeBefore");
  }, { commandName: "Bring the layers back" });
}

async function edit() {
  const link = document.getElementById("link").value;
  const server = parsed(link);
  localStorage.setItem("link", link);
  const target = app.activeDocument, layer = target && target.activeLayers[0];
  if (!layer || target.activeLayers.length !== 1) throw new Error("Choose one layer first.");
  say("Sending the layer.");
  const sent = await asked(server, "/web/edits", {
    method: "POST", body: await layerFile(target, layer), headers: { "X-Name": "layer.png" },
  });
  const { id } = await sent.json();
  await shell.openExternal(`${server.address}/#token=${server.token}&edit=${id}`,
    "The editor opens in the browser.");
  say("Edit it in the browser, and press “Send back” there.");
  for (;;) {
    const answer = await asked(server, `/web/edits/${id}/files/layers`, { isWaiting: true });
    if (answer.ok) { await bringBack(target, layer, await answer.arrayBuffer()); break; }
    await new Promise((go) => setTimeout(go, PAUSE));
  }
  say("The edit is in a group above the layer.");
}

document.getElementById("link").value = localStorage.getItem("link") || "";
const button = document.getElementById("send");
button.addEventListener("click", async () => {
  button.disabled = true;
  try { await edit(); } catch (error) { say(error.message); }
  button.disabled = false;
});
