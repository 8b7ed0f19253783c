// The 3-D view and the strip below it, as far as the page knows them: what they show of store and results.

import { contacts } from "./contacts.js";
import { duration } from "./content.js";
import { $, option, write } from "./dom.js";
import { turn } from "./contacts.js";
import { poseAt } from "./motion_recording.js";
import { Strip } from "./strip.js";
import { STANDARD, View } from "./view.js";

/** @import { Result } from "./types.js" */

const FOLLOW = 0.12; // of the way to the body, in every picture

export class Stage {
  /** @param {import("./store.js").Store} store @param {import("./results.js").Results} results @param {import("./player.js").Player} player @param {import("./sources.js").Sources} sources */
  constructor(store, results, player, sources) {
    this.store = store;
    this.results = results;
    this.player = player;
    this.sources = sources;
    /** @type {any} */
    this.scene = null;
    /** @type {View | null} */
    this.view = null;
    /** @type {Strip | null} */
    this.strip = null;
    this.faced = "";
    this.touching = "";
    $("standard").replaceChildren(option("", "View…"), ...Object.entries(STANDARD).map(([value, text]) => option(value, text)));
  }

  /** @param {any} scene */
  know(scene) {
    this.scene = scene;
    this.sources.library = new Set(scene.starts.map((/** @type {any} */ s) => s.name));
    this.sources.mirror = { ...scene.mirror, word: scene.mirrored };
  }

  /** Makes the view; false where the browser has no WebGL. */
  begin() {
    if (this.view) return true;
    try { this.view = new View($("view"), this.scene); } catch { return false; }
    this.settings();
    const { active } = this.results;
    if (active) this.face(active);
    return true;
  }

  get fence() { return this.view?.fence; }

  /** After the picture at hand, since another one would queue up behind it. @param {() => void} call */
  whenFree(call) {
    if (this.view) this.view.fence.then(call);
    else call();
  }

  arrange() { this.view?.arrange(this.store.variants.map((v) => v.slot), this.store.active); }

  settings() {
    if ($("standard").value) this.look($("standard").value);
    $("standard").value = "";
    this.sources.wanted = $("source").checked;
    if (!this.view) return;
    this.view.follow = $("follow").checked;
    this.view.apart = $("apart").checked;
    this.arrange();
  }

  /** @param {string} from */
  look(from) {
    const motion = this.results.active?.motion;
    if (!this.view || !motion) return;
    const [ahead, aside] = turn([...motion.pose(Math.max(motion.count - 1, 0)).subarray(3, 7)], [1, 0, 0]);
    this.view.look(from, Math.atan2(aside, ahead));
  }

  /** The ground of a new place, and the camera at the side of a new start. @param {Result} result */
  face({ motion }) {
    if (!this.view || !motion) return;
    if (JSON.stringify(this.view.ground ?? null) !== JSON.stringify(motion.ground)) this.view.setGround(motion.ground);
    const { curve, region, place } = this.store.now;
    const start = JSON.stringify([curve.start, curve.pose, region, place]);
    if (start === this.faced) return;
    this.faced = start;
    this.view.face(motion.pose(0), this.scene.links.indexOf(this.scene.links.includes("neck") ? "neck" : "head"));
  }

  /** The variants' poses at the player's time; returns whether the view shows them now. @param {boolean} now */
  draw(now) {
    const { view, store, results, player } = this, frame = (/** @type {any} */ motion) => player.frame(motion, this.scene.control_dt);
    const active = results.active?.motion;
    this.showContacts(active && active.count ? active : null, frame);
    if (!view) return true;
    for (const { slot } of store.variants) {
      const motion = results.shown.get(slot)?.motion;
      view.pose(slot, motion?.count ? motion : null, motion?.count ? frame(motion) : 0);
    }
    this.poseSource(active);
    if (view.follow && active?.count) view.centre(active.pose(frame(active)), FOLLOW);
    return view.draw(now);
  }

  /** The clip behind the curve, at the same share of its duration, from where the body begins. @param {import("./motion.js").Motion | null | undefined} motion */
  poseSource(motion) {
    const { view, player } = this, recording = this.sources.wanted ? this.sources.recording : null;
    if (!view) return;
    if (!recording || !motion?.count) return view.poseSource(null, () => new Float32Array());
    const share = Math.min(player.time / duration(this.store.now), 1), first = poseAt(recording, 0), begin = motion.pose(0);
    const { x, y } = view.bodies.get(this.store.active)?.group.position ?? { x: 0, y: 0 }; // aside, too
    view.source.group.position.set(x + begin[0] - first[0], y + begin[1] - first[1], 0);
    view.poseSource(`${this.store.now.reference.name} ${this.sources.side} ${Math.round(share * recording.total)}`, () => poseAt(recording, share));
  }

  /** @param {import("./motion.js").Motion | null} motion @param {(motion: any) => number} frame */
  showContacts(motion, frame) {
    const key = motion ? `${motion.number} ${frame(motion)}` : "";
    if (key === this.touching) return;
    this.touching = key;
    const found = motion ? contacts(this.scene, motion.pose(frame(motion)), motion.ground) : [];
    write($("contacts"), found.length ? `On the ground: ${found.join(", ")}` : "");
  }

  /** Whether the strip is up to date, or being drawn. */
  drawStrip() {
    const { view, results } = this, result = results.active;
    if (!view) return false;
    if (result?.error) this.strip?.clear();
    if (!result?.verdict || !result.motion) return Boolean(result?.error);
    this.strip ??= new Strip($("strip"), this.scene, view.software);
    this.strip.draw(result.motion, view.orbit.azimuth, () => !view.fence.waiting);
    return true;
  }

  theme() {
    this.view?.theme();
    this.strip?.theme();
  }

  still() { return this.view?.still() ?? Promise.resolve(null); }
}
