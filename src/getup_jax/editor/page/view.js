// The 3-D view: ground, the variants' bodies, light, and a camera that orbits and follows.

import {
  Color, DirectionalLight, Fog, HemisphereLight, PCFShadowMap, PerspectiveCamera, Scene, Vector3, WebGLRenderer,
} from "./vendor/three.min.js";
import { Body, SOURCE } from "./body.js";
import { asideOf, cameraAt, pinch, rowDistance } from "./camera.js";
import { drawsInSoftware, Fence } from "./gpu.js";
import { makeGround } from "./ground.js";
import { heightAt } from "./height.js";

const LOOK_AT_M = 0.6; // above the ground
const FOG_M = [9, 26]; // from the camera
const FOG_PATCH_M = [4.5, 10.5]; // a piece of irregular ground fades before its edge
const STILL_M = 0.002; // the camera does not follow less than this
const FARTHEST_M = 15; // of the camera from what it looks at
const STILL = [1920, 1080]; // pixels of a picture that is exported
const SLOW_MS = 50; // a picture; they are drawn more plainly when slower than this

/** Directions to look from, in the order of their keys. @type {Record<string, string>} */
export const STANDARD = { own: "Start (0)", front: "Front (1)", side: "Side (3)", top: "Top (7)" };

/** @typedef {import("./motion.js").Motion} Motion */

export class View {
  /** @param {HTMLCanvasElement} canvas @param {any} scene */
  constructor(canvas, scene) {
    this.canvas = canvas;
    this.spec = scene;
    this.software = drawsInSoftware();
    this.plain = this.software;
    this.mean = 0;
    this.colours = { sky: "", floor: "", line: "" };
    this.renderer = new WebGLRenderer({ canvas, antialias: !this.software });
    this.fence = new Fence(this.renderer.getContext());
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(38, 1, 0.1, 60);
    this.camera.up.set(0, 0, 1);
    this.orbit = { azimuth: 0.6, elevation: 0.28, distance: 4.2 };
    this.target = new Vector3(0, 0, LOOK_AT_M);
    this.follow = true;
    this.home = this.orbit.azimuth;
    this.apart = false;
    this.arranged = "";
    /** @type {Map<number, Body>} by slot */
    this.bodies = new Map();
    this.source = new Body(scene.shapes, scene.links.length);
    this.source.dress(true, SOURCE);
    this.source.group.visible = false;
    this.scene.add(this.source.group);
    this.light();
    this.theme();
    this.listen();
    new ResizeObserver(() => { this.resize(); this.dirty = true; }).observe(canvas);
    this.resize();
  }

  light() {
    this.scene.add(new HemisphereLight("#ffffff", "#9aa3ad", 1.5));
    this.sun = new DirectionalLight("#ffffff", 2.2);
    this.sun.castShadow = !this.plain;
    this.sun.shadow.mapSize.set(1024, 1024);
    Object.assign(this.sun.shadow.camera, { left: -2.5, right: 2.5, top: 2.5, bottom: -2.5, near: 1, far: 12 });
    this.sun.shadow.bias = -0.0005;
    this.scene.add(this.sun, this.sun.target);
  }

  // Colours of the page's theme.
  theme() {
    const style = getComputedStyle(document.documentElement);
    const colour = (/** @type {string} */ name) => style.getPropertyValue(name).trim();
    this.scene.background = new Color(colour("--sky"));
    this.colours = { sky: colour("--sky"), floor: colour("--floor"), line: colour("--floor-line") };
    this.setGround(this.ground ?? null);
  }

  /** @param {import("./types.js").Ground | null} ground null: a plane */
  setGround(ground) {
    this.ground = ground;
    if (this.floor) {
      this.scene.remove(...this.floor);
      for (const part of this.floor) { part.geometry.dispose(); part.material.dispose(); }
    }
    this.floor = makeGround(ground, this.colours);
    const [near, far] = ground ? FOG_PATCH_M : FOG_M;
    this.scene.fog = new Fog(this.colours.sky, near, far);
    this.scene.add(...this.floor);
    this.dirty = true;
  }

  /** One body a variant; the active one is solid, the others are ghosts. @param {number[]} slots @param {number} active */
  arrange(slots, active) {
    const arranged = `${active} of ${slots}, ${this.apart}`;
    if (this.arranged === arranged) return;
    this.arranged = arranged;
    for (const slot of slots) {
      if (this.bodies.has(slot)) continue;
      const body = new Body(this.spec.shapes, this.spec.links.length);
      body.group.visible = false;
      this.bodies.set(slot, body);
      this.scene.add(body.group);
    }
    for (const [slot, body] of this.bodies) {
      if (!slots.includes(slot)) this.hide(body);
      body.dress(slot !== active, slot);
      const aside = this.apart ? asideOf(slots.indexOf(slot), slots.length) : 0;
      body.group.position.set(-aside * Math.sin(this.home), aside * Math.cos(this.home), 0);
    }
    if (this.apart) this.seeRow(slots.length);
    this.dirty = true;
  }

  /** @param {number} count of the variants side by side */
  seeRow(count) {
    const half = Math.tan((this.camera.fov * Math.PI) / 360) * this.camera.aspect;
    this.orbit.distance = Math.max(this.orbit.distance, Math.min(rowDistance(count, half), FARTHEST_M));
  }

  /** @param {Body} body */
  hide(body) {
    body.shown = null;
    body.group.visible = false;
    this.dirty = true;
  }

  /** A frame of a variant's motion; null hides the variant. @param {number} slot @param {Motion | null | undefined} motion @param {number} frame */
  pose(slot, motion, frame) {
    const body = this.bodies.get(slot);
    if (body) this.put(body, motion ? `${motion.number} ${frame}` : null, () => /** @type {Motion} */ (motion).pose(frame));
  }

  /** A pose of the clip behind the curve; null hides it. @param {string | null} key @param {() => Float32Array} values */
  poseSource(key, values) { this.put(this.source, key, values); }

  /** @param {Body} body @param {string | null} key @param {() => Float32Array} values */
  put(body, key, values) {
    if (body.shown === key) return;
    body.shown = key;
    body.group.visible = key !== null;
    if (key !== null) body.pose(values());
    this.dirty = true;
  }

  /** Looks at a lying body from its side. @param {Float32Array} values seven numbers a link @param {number} neck its number */
  face(values, neck) {
    const dx = values[7 * neck] - values[0], dy = values[7 * neck + 1] - values[1];
    if (Math.hypot(dx, dy) > 0.1) this.orbit.azimuth = Math.atan2(dy, dx) - 0.42 * Math.PI;
    this.home = this.orbit.azimuth;
    this.centre(values, 1);
  }

  /** From one of the standard directions; front: that in which the last pose looks. @param {string} from @param {number} heading rad */
  look(from, heading) {
    if (from === "front") Object.assign(this.orbit, { azimuth: heading, elevation: 0.08 });
    else if (from === "side") Object.assign(this.orbit, { azimuth: heading - Math.PI / 2, elevation: 0.08 });
    else if (from === "top") Object.assign(this.orbit, { elevation: 1.5 });
    else Object.assign(this.orbit, { azimuth: this.home, elevation: 0.28, distance: 4.2 });
    this.dirty = true;
  }

  /** Towards a body. @param {Float32Array} values @param {number} share of the way */
  centre(values, share) {
    const level = this.ground ? heightAt(this.ground, values[0], values[1]) : 0;
    const aim = new Vector3(values[0], values[1], level + LOOK_AT_M);
    if (aim.distanceTo(this.target) < STILL_M) return;
    this.target.lerp(aim, share);
    this.dirty = true;
  }

  // Draws if something changed; never before the last picture is done, since pictures that queue up
  // show late. `now` is for a picture that a person waits for: others leave a processor that draws by
  // itself as long a rest as they took. Returns whether all of it is given to the renderer.
  draw(now = false) {
    if (!this.dirty) return true;
    const rest = this.software && !now ? this.fence.took : 0;
    if (this.fence.waiting || performance.now() < this.fence.free + rest) return false;
    this.dirty = false;
    this.stand();
    this.sun.position.copy(this.target).add(new Vector3(1.6, -1.2, 4.5));
    this.sun.target.position.copy(this.target);
    this.renderer.render(this.scene, this.camera);
    this.fence.set();
    this.fence.then(() => this.pace(this.fence.took));
    return true;
  }

  /** Puts the camera into its place, above whatever the ground is there. */
  stand() {
    const { camera, target, ground } = this;
    camera.position.set(...cameraAt(target, this.orbit, ground));
    camera.lookAt(target);
  }

  /** The picture at hand, larger. @returns {Promise<Blob | null>} */
  still() {
    const { renderer, camera, canvas } = this, [width, height] = STILL;
    renderer.setPixelRatio(1);
    renderer.setSize(width, height, false);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    this.stand();
    renderer.render(this.scene, camera);
    return new Promise((resolve) => canvas.toBlob((blob) => {
      this.resize();
      this.dirty = true;
      resolve(blob);
    }));
  }

  /** Without shadows and sharp edges where they cost too much. @param {number} took ms, of the last picture */
  pace(took) {
    // the first ones compile shaders, and a single one may be slow for another reason
    this.mean += 0.1 * (Math.min(took, 2 * SLOW_MS) - this.mean);
    if (this.plain || this.mean < SLOW_MS) return;
    this.plain = true;
    this.sun.castShadow = false;
    this.resize();
    this.dirty = true;
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.renderer.setPixelRatio(this.plain ? Math.min(devicePixelRatio, this.software ? 1 : 0.75) : Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / Math.max(height, 1);
    this.camera.updateProjectionMatrix();
  }

  /** @param {number} azimuth @param {number} elevation rad @param {number} zoom times as far */
  turn(azimuth, elevation, zoom = 1) {
    this.orbit.azimuth += azimuth;
    this.orbit.elevation = Math.min(Math.max(this.orbit.elevation + elevation, -0.05), 1.5);
    this.orbit.distance = Math.min(Math.max(this.orbit.distance * zoom, 1), FARTHEST_M);
    this.dirty = true;
  }

  listen() {
    const { canvas } = this;
    /** @type {Map<number, PointerEvent>} */
    const fingers = new Map();
    canvas.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const [one, two] = [...fingers.values()];
      if (two) this.turn(0, 0, pinch(one, two, before, event));
      else this.turn(-0.008 * (event.clientX - before.clientX), 0.008 * (event.clientY - before.clientY));
      fingers.set(event.pointerId, event);
    });
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      if (event.button === 0) fingers.set(event.pointerId, event);
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => fingers.delete(/** @type {PointerEvent} */ (event).pointerId));
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.turn(0, 0, Math.exp(0.0012 * event.deltaY));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      /** @type {Record<string, [number, number, number?]>} */
      const turns = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.08], ArrowDown: [0, -0.08], "+": [0, 0, 0.9], "-": [0, 0, 1.1] };
      if (!(event.key in turns) || event.ctrlKey || event.metaKey) return;
      event.preventDefault();
      this.turn(...turns[event.key]);
    });
  }
}
