// The dialog that writes the motion as a file: which part of it, at what rate; films with progress.

import { $, download, el, option } from "./dom.js";
import { asked, duration } from "./content.js";
import { say } from "./notice.js";

const FORMATS = [
  ["glb", "GLB: animated character (Blender, Unreal, web)"], ["bvh", "BVH: skeleton (Blender, MotionBuilder, Maya)"], ["usd", "USD: animated character"],
  ["mp4", "MP4: film"], ["npz", "npz: clip for getup-motion"], ["csv", "CSV: a row a frame"], ["png", "PNG: the picture at hand"],
];
const PARTS = [["rise", "without the standing at the end"], ["whole", "the whole motion"], ["range", "from in to out"]];
const RATES = ["24", "25", "30", "60"];
const WITH = { part: ["glb", "bvh", "usd", "mp4"], rate: ["glb", "bvh", "usd", "mp4"], turn: ["mp4"] };

export class Exports {
  /**
   * @param {import("./link.js").Link} link @param {import("./store.js").Store} store
   * @param {{ scene: () => any, range: () => [number, number], still: () => Promise<Blob | null> }} model
   */
  constructor(link, store, model) {
    this.link = link;
    this.store = store;
    this.model = model;
    /** @type {number | null} the request under way */
    this.number = null;
    $("export").addEventListener("click", () => this.open());
    $("dialog").addEventListener("close", () => { if (this.number !== null) this.cancel(); }); // by Escape
    link.addEventListener("progress", (/** @type {any} */ { detail }) => {
      if (detail.number === this.number && $("export-progress")) $("export-progress").value = detail.share;
    });
  }

  open() {
    const { formats } = this.model.scene() ?? {}, dialog = $("dialog"), missing = formats ?? {};
    const formatOptions = FORMATS.map(([value, text]) => option(value, missing[value] ? `${text} – needs ${missing[value]}` : text, Boolean(missing[value])));
    dialog.replaceChildren(
      el("h2", { id: "dialog-title" }, "Export the motion"),
      el("label", {}, "Format ", el("select", { id: "format", onchange: () => this.show() }, ...formatOptions)),
      el("label", { id: "part-row" }, "Part ", el("select", { id: "part" }, ...PARTS.map(([v, t]) => option(v, t)))),
      el("label", { id: "rate-row" }, "Frames/s ", el("select", { id: "rate" }, ...RATES.map((r) => option(r, r)))),
      el("label", { id: "turn-row" }, el("input", { id: "turn", type: "checkbox" }), " turn once around the body"),
      el("p", { class: "note", id: "format-note" }),
      el("progress", { id: "export-progress", max: 1, value: 0, hidden: true }),
      el("p", { class: "buttons" },
        el("button", { id: "export-go", onclick: () => this.go() }, "Export"),
        el("button", { id: "export-cancel", onclick: () => this.cancel() }, "Cancel")),
    );
    $("part").value = "whole";
    $("rate").value = "30";
    $("format").value = FORMATS.find(([value]) => !missing[value])?.[0] ?? "bvh";
    this.show();
    dialog.showModal();
  }

  show() {
    const format = $("format").value;
    for (const [row, formats] of Object.entries(WITH)) $(`${row}-row`).hidden = !formats.includes(format);
    $("format-note").textContent = NOTES[format] ?? "";
  }

  /** From and to (s) of the part that is chosen; null: all of it. @returns {[number, number] | null} */
  part() {
    const part = $("part").value;
    if (part === "range") return this.model.range();
    return part === "rise" ? [0, duration(this.store.now)] : null;
  }

  request() {
    const format = $("format").value, part = WITH.part.includes(format) ? this.part() : null;
    const rate = WITH.rate.includes(format) ? { rate: Number($("rate").value) } : {};
    const cut = part ? { from: part[0], to: part[1] } : {};
    return { type: "export", format, ...asked(this.store.now), name: this.store.now.curve.name, ...rate, ...cut, ...(format === "mp4" ? { turn: $("turn").checked } : {}) };
  }

  async go() {
    const request = this.request();
    const name = this.store.fileName(`${request.name}.${request.format}`);
    if (request.format === "png") return this.still(name);
    const button = $("export-go");
    button.disabled = true;
    $("export-progress").hidden = false;
    try {
      const answer = this.link.ask(request);
      this.number = this.link.number;
      const file = await answer;
      download(name, file.payload);
      say(`${name} exported`);
    } catch (error) { say(/** @type {Error} */ (error).message, true); }
    this.number = null;
    if (button.isConnected) $("dialog").close();
  }

  /** @param {string} name */
  async still(name) {
    const picture = await this.model.still();
    if (!picture) return say("There is no picture: this browser draws no 3-D view, since it has no WebGL, or lost it. The other formats need none.", true);
    download(name, picture);
    $("dialog").close();
    say(`${name} exported`);
  }

  /** Ends what is under way, or closes. */
  cancel() {
    if (this.number === null) return $("dialog").close();
    this.link.send({ type: "cancel", of: this.number });
  }
}

/** @type {Record<string, string>} */
const NOTES = {
  glb: "The character with its motion as an animation, metres, Y up.",
  bvh: "Rest pose: a T-pose that faces +Z, Y up, centimetres; in Blender import it with scale 0.01.",
  usd: "The character with its motion, Z up.",
  mp4: "1920 × 1080; without a GPU it takes a while. You can cancel it.",
  png: "1920 × 1080, as the camera stands now.",
};
