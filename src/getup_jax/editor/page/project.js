// A project: variants with their undo, and what was imported. It is read from the browser's storage or
// from a file; whatever is read is checked, since a file may come from anywhere.

import { contentOf, DURATION_S, keptName } from "./content.js";
import { fromBase64, toBase64 } from "./base64.js";
import { clamp, kept } from "./features.js";
import { begin } from "./history.js";
import { FEATURES, POINTS } from "./spline.js";

/** @import { Content, Curve, Feature, History, Imported, Key, Project, Recording, Variant } from "./types.js" */

export const FORMAT = 1;
export const SUFFIX = ".getup.json";
export const SLOTS = 4, LETTERS = "ABCD"; // of the variants
export const MOST_IMPORTED = 200, MOST_LETTERS = 200;
const MOST_KEYS = 1000, MOST_STEPS = 200;

/** @param {Curve} curve @param {string} name @returns {Project} */
export function project(curve, name) {
  return { ...empty(name), variants: [{ slot: 0, history: begin(contentOf(curve)) }] };
}

/** @param {string} name @returns {Project} */
function empty(name) {
  return { format: FORMAT, id: newId(), name, revision: 0, saved: 0, variants: [], active: 0, removed: [], imported: [] };
}

/** `crypto.randomUUID` is missing where the page comes from another machine without a certificate. */
export function newId() {
  return [...crypto.getRandomValues(new Uint8Array(12))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

/** The same project under another name and identity. @param {Project} from @param {string} name @returns {Project} */
export function copyOf(from, name) { return { ...from, id: newId(), name, revision: 0 }; }

/** @param {Project} from */
export function toText(from) {
  const imported = from.imported.map((one) => ({ ...one, recording: one.recording && { ...one.recording, frames: toBase64(one.recording.frames) } }));
  return JSON.stringify({ ...from, imported });
}

/** A project with an identity of its own out of a file's text; an Error says what is wrong. @param {string} text @param {string} file @returns {Project} */
export function fromText(text, file) {
  let content;
  try { content = JSON.parse(text); } catch { throw new Error(`${file}: expected a project that was exported here, got no JSON`); }
  try { return { ...checked(content), id: newId(), revision: 0 }; } catch (error) {
    throw new Error(`${file}: ${/** @type {Error} */ (error).message}`);
  }
}

/** A project that has every part in its place. @param {any} content @returns {Project} */
export function checked(content) {
  if (content?.format !== FORMAT) throw new Error(`format: expected a project of format ${FORMAT}, got ${JSON.stringify(content?.format)}`);
  const variants = list(content.variants, "variants", 1, SLOTS).map(variant);
  if (new Set(variants.map((v) => v.slot)).size < variants.length) throw new Error("variants: expected each slot once");
  const active = variants.some((v) => v.slot === content.active) ? content.active : variants[0].slot;
  return {
    format: FORMAT, id: String(content.id), name: text(content.name, "name"), variants, active,
    revision: Number(content.revision) || 0, saved: Number(content.saved) || 0, removed: list(content.removed ?? [], "removed", 0, SLOTS).map(variant),
    imported: list(content.imported ?? [], "imported", 0, MOST_IMPORTED).map(importedOne),
  };
}

/** @param {any} v @returns {Variant} */
function variant(v) {
  const { history } = v ?? {};
  const contents = (/** @type {any} */ x) => list(x ?? [], "history", 0, MOST_STEPS).map(content);
  /** @type {History} */
  const found = { now: content(history?.now), past: contents(history.past), future: contents(history.future), tag: "", at: 0 };
  return { slot: whole(v.slot, "slot", SLOTS), history: found };
}

/** @param {any} c @returns {Content} */
function content(c) {
  /** @type {Content} */
  const found = { curve: curve(c?.curve), keys: {}, reference: curve(c.reference ?? c.curve), region: whole(c.region ?? 0, "region", 100), place: whole(c.place ?? 0, "place", 10_000), wishes: list(c.wishes ?? [], "wishes", 0, 50).map(wish) };
  for (const feature of FEATURES) if (c.keys?.[feature]) found.keys[feature] = keys(c.keys[feature], feature);
  return found;
}

/** @param {any} w @returns {import("./types.js").Wish} */
function wish(w) {
  return { name: text(w?.name, "wish"), from: number(w.from, "from"), to: number(w.to, "to"), contacts: list(w.contacts, "contacts", 0, 20).map((x) => text(x, "contact")) };
}

/** @param {any} c @returns {Curve} */
export function curve(c) {
  if (typeof c !== "object" || c === null) throw new Error("curve: expected a curve");
  /** @type {any} */
  const found = { name: keptName(text(c.name, "name")) || "curve", strategy: text(c.strategy, "strategy"), start: text(c.start, "start") };
  const durations = list(c.durations, "durations", 1, 16).map((x) => number(x, "durations"));
  found.durations = durations.map((seconds) => clamp(seconds, DURATION_S[0], DURATION_S[1]));
  for (const feature of FEATURES) found[feature] = list(c[feature], feature, POINTS, POINTS).map((x) => number(x, feature));
  if (c.pose) found.pose = list(c.pose, "pose", 8, 500).map((x) => number(x, "pose"));
  return found;
}

/** @param {any} values @param {Feature} feature @returns {Key[]} */
function keys(values, feature) {
  const found = list(values, `${feature}: keys`, 2, MOST_KEYS).map((key) => ({
    time: number(key?.time, "time"), value: kept(feature, number(key.value, "value")), kind: ["flat", "linear"].includes(key.kind) ? key.kind : "auto",
  }));
  const rising = found.every((key, i) => (i ? key.time > found[i - 1].time : key.time === 0)) && found[found.length - 1].time === 1;
  if (!rising) throw new Error(`${feature}: keys: expected rising times from 0 to 1`);
  return found;
}

/** @param {any} one @returns {Imported} */
function importedOne(one) {
  return { curve: curve(one?.curve), file: text(one.file, "file"), recording: recording(one.recording) };
}

/** @param {any} r @returns {Recording | null} */
function recording(r) {
  if (!r) return null;
  const frames = typeof r.frames === "string" ? fromBase64(r.frames) : r.frames;
  const size = r.total * (r.links * 7 + 3);
  if (!(frames instanceof Float32Array) || frames.length !== size) throw new Error(`recording: expected ${size} numbers`);
  return { fps: number(r.fps, "fps"), total: r.total, links: r.links, frames };
}

/** @param {any} x @param {string} where @param {number} least @param {number} most @returns {any[]} */
function list(x, where, least, most) {
  if (!Array.isArray(x) || x.length < least || x.length > most) throw new Error(`${where}: expected a list of ${least} to ${most}`);
  return x;
}

/** @param {any} x @param {string} where @returns {number} */
function number(x, where) {
  if (typeof x !== "number" || !Number.isFinite(x)) throw new Error(`${where}: expected a number, got ${JSON.stringify(x)}`);
  return x;
}

/** @param {any} x @param {string} where @param {number} end */
function whole(x, where, end) {
  if (!Number.isInteger(x) || x < 0 || x >= end) throw new Error(`${where}: expected a whole number below ${end}, got ${JSON.stringify(x)}`);
  return x;
}

/** @param {any} x @param {string} where @returns {string} */
function text(x, where) {
  if (typeof x !== "string" || x.length > MOST_LETTERS) throw new Error(`${where}: expected a text, got ${JSON.stringify(x)}`);
  return x;
}
