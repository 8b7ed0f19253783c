// The strip of poses below the view: the motion at equal steps of time, seen from the side. It is
// drawn a pose at a time when the page has nothing else to do, and shown when the last pose is there.

import { Color, DirectionalLight, Group, HemisphereLight, OrthographicCamera, Scene, WebGLRenderer } from "./vendor/three.min.js";
import { Body } from "./body.js";
import { Fence } from "./gpu.js";
import { heightAt } from "./height.js";

/** @import { Motion } from "./motion.js" */

const POSES = 7;
const SPACING_M = 1.8;
const BEFORE_M = 1.15, AFTER_M = 0.7; // room for a lying first pose and a standing last one
const HEIGHT_M = 1.95;
const PATIENCE_MS = 400; // the longest wait for an idle moment

const whenIdle = window.requestIdleCallback?.bind(window) ?? ((call) => setTimeout(call, 20));

export class Strip {
  /** @param {HTMLCanvasElement} canvas shown, 2-D; the poses are drawn on one of their own behind it @param {any} scene @param {boolean} software the processor draws */
  constructor(canvas, scene, software) {
    this.canvas = canvas;
    this.renderer = new WebGLRenderer({ canvas: document.createElement("canvas"), antialias: !software, preserveDrawingBuffer: true });
    this.renderer.autoClear = false; // a pose is added to those before it
    this.fence = new Fence(this.renderer.getContext());
    this.scene = new Scene();
    this.scene.add(new HemisphereLight("#ffffff", "#9aa3ad", 1.9));
    const sun = new DirectionalLight("#ffffff", 1.6);
    sun.position.set(1, -2, 3);
    this.scene.add(sun);
    this.camera = new OrthographicCamera(0, 1, 1, 0, 0.1, 20);
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(0, -8, 0);
    this.camera.lookAt(0, 0, 0);
    this.body = new Body(scene.shapes, scene.links.length);
    this.place = new Group();
    this.place.add(this.body.group);
    this.scene.add(this.place);
    this.across = 1;
    this.work = 0; // the drawing at hand; an older one stops
    this.theme();
  }

  theme() {
    this.sky = new Color(getComputedStyle(document.documentElement).getPropertyValue("--sky").trim());
  }

  /** @param {Motion | null} motion @param {number} azimuth where the view's camera stands @param {() => boolean} may false while others need the renderer */
  draw(motion, azimuth, may) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!motion?.count || !width) return;
    const work = ++this.work;
    let pose = 0, last = performance.now(), shown = last;
    const step = () => {
      if (work !== this.work) return;
      // a view that always draws must not keep the strip from its turn
      const turn = may() || performance.now() - last > PATIENCE_MS;
      if (turn && !this.fence.waiting) {
        last = performance.now();
        if (pose === 0) this.begin(width, height);
        this.add(motion, azimuth, pose++);
        this.fence.set();
        if (performance.now() - shown > PATIENCE_MS) { // as they come, where that takes long
          shown = performance.now();
          this.fence.then(() => { if (work === this.work) this.show(); });
        }
      }
      if (pose < POSES) whenIdle(step, { timeout: PATIENCE_MS });
      else this.fence.then(() => { if (work === this.work) this.finish(); });
    };
    whenIdle(step, { timeout: PATIENCE_MS });
  }

  // A drawing that is under way is of something that is no longer asked for.
  cancel() {
    this.work += 1;
    this.canvas.classList.add("stale");
  }

  // Of a motion that there is not.
  clear() {
    this.cancel();
    this.canvas.getContext("2d")?.clearRect(0, 0, this.canvas.width, this.canvas.height);
  }

  /** @param {number} width @param {number} height px */
  begin(width, height) {
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.across = Math.max(POSES * SPACING_M, (HEIGHT_M * width) / height);
    const up = (this.across * height) / width;
    Object.assign(this.camera, { left: -this.across / 2, right: this.across / 2, top: up - 0.12, bottom: -0.12 });
    this.camera.updateProjectionMatrix();
    this.renderer.setClearColor(this.sky);
    this.renderer.clear();
  }

  /** @param {Motion} motion @param {number} azimuth @param {number} i number of the pose */
  add(motion, azimuth, i) {
    const frame = Math.min(Math.round((i * (motion.total - 1)) / (POSES - 1)), motion.count - 1);
    const values = motion.pose(frame);
    this.body.pose(values);
    const level = motion.ground ? heightAt(motion.ground, values[0], values[1]) : 0;
    this.body.group.position.set(-values[0], -values[1], -level);
    this.place.rotation.z = -azimuth - Math.PI / 2;
    this.place.position.x = BEFORE_M - this.across / 2 + (i / (POSES - 1)) * (this.across - BEFORE_M - AFTER_M);
    this.renderer.render(this.scene, this.camera);
  }

  show() {
    const drawn = this.renderer.domElement;
    this.canvas.width = drawn.width;
    this.canvas.height = drawn.height;
    this.canvas.getContext("2d")?.drawImage(drawn, 0, 0);
    this.canvas.classList.remove("stale");
  }

  finish() {
    this.show();
    this.canvas.dataset.drawn = String(this.work);
  }
}
