// Runs the panel in Node with a stand-in for what it calls of Photoshop's UXP API (version 24.2).
// node photoshop_stub.js MAIN.js FOLDER LINK: the layer's file is FOLDER/layer.png. Prints the link
// that is opened, then what became of the document, as JSON.
"use strict";

const fs = require("fs"), path = require("path");
const [main, folder, link] = process.argv.slice(2);

const entry = (name) => ({
  name,
  read: async () => { const b = fs.readFileSync(path.join(folder, name)); return b.buffer.slice(b.byteOffset, b.byteOffset + b.length); },
  write: async (data) => fs.writeFileSync(path.join(folder, name), Buffer.from(data)),
});
let isModal = false;
const modally = () => { if (!isModal) throw new Error("may only be called in executeAsModal"); };
class Layer {
  constructor(name, document) { Object.assign(this, { name, document }); }
  async duplicate(target) {
    modally();
    const copy = new Layer(this.name, target);
    target.layers.unshift(copy);
    return copy;
  }
  async move(beside, where) {
    modally();
    if (where !== "placeBefore") throw new Error(`no such place: ${where}`);
    const { layers } = this.document;
    layers.splice(layers.indexOf(this), 1);
    layers.splice(layers.indexOf(beside), 0, this);
  }
}
class Document {
  constructor() {
    Object.assign(this, { layers: [], width: 640, height: 427, resolution: 72, isOpen: true });
    this.saveAs = { png: async (file) => { modally(); if (file.name !== "layer.png") throw new Error(file.name); } };
  }
  get activeLayers() { return this.layers.slice(-1); }
  async closeWithoutSaving() { modally(); this.isOpen = false; }
  async createLayerGroup({ name, fromLayers }) {
    modally();
    const group = new Layer(name, this);
    group.layers = this.layers.filter((layer) => fromLayers.includes(layer));
    this.layers = [group, ...this.layers.filter((layer) => !fromLayers.includes(layer))];
    return group;
  }
}
const target = new Document();
target.layers = [new Layer("Above", target), new Layer("Mine", target)];
const opened = [target];
const photoshop = {
  app: {
    activeDocument: target,
    documents: { add: async () => { modally(); const made = new Document(); opened.push(made); return made; } },
    open: async (file) => {
      modally();
      const back = new Document();
      back.layers = ["Object", "Background"].map((name) => new Layer(name, back));
      if (file.name !== "back.psd") throw new Error(file.name);
      opened.push(back);
      return back;
    },
  },
  core: { executeAsModal: async (work) => { isModal = true; try { return await work(); } finally { isModal = false; } } },
};
const uxp = {
  shell: { openExternal: async (url) => process.stdout.write(`${url}\n`) },
  storage: { formats: { binary: "binary" }, localFileSystem: {
    getTemporaryFolder: async () => ({ createFile: async (name) => entry(name) }) } },
};
const elements = { link: { value: "" }, said: { textContent: "" }, send: { addEventListener: (_, work) => { elements.send.press = work; } } };
global.document = { getElementById: (id) => elements[id] };
global.localStorage = { getItem: () => null, setItem: () => {} };
new Function("require", fs.readFileSync(main, "utf8"))((name) => ({ photoshop, uxp })[name]);
elements.link.value = link;
elements.send.press().then(() => {
  const names = (layers) => layers.map((l) => (l.layers ? [l.name, ...names(l.layers)] : l.name));
  process.stdout.write(JSON.stringify({ said: elements.said.textContent, layers: names(target.layers),
    open: opened.filter((d) => d.isOpen).length }) + "\n");
});
