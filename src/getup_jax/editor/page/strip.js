// The strip of poses below the view: the motion at equal steps of time, seen from the side.

import { Color, DirectionalLight, Group, HemisphereLight, OrthographicCamera, Scene, WebGLRenderer } from "./vendor/three.min.js";
import { Body } from "./body.js";
import { heightAt } from "./view.js";

const POSES = 7;
const SPACING_M = 1.8;
const BEFORE_M = 1.15, AFTER_M = 0.7; // room for a lying first pose and a standing last one
const HEIGHT_M = 1.95;

export class Strip {
  constructor(canvas, scene) {
    this.canvas = canvas;
    this.renderer = new WebGLRenderer({ canvas, antialias: true });
    this.scene = new Scene();
    this.scene.add(new HemisphereLight("#ffffff", "#9aa3ad", 1.9));
    const sun = new DirectionalLight("#ffffff", 1.6);
    sun.position.set(1, -2, 3);
    this.scene.add(sun);
    this.camera = new OrthographicCamera(0, 1, 1, 0, 0.1, 20);
    this.camera.up.set(0, 0, 1);
    this.places = Array.from({ length: POSES }, () => {
      const body = new Body(scene.shapes, scene.links.length);
      const place = new Group();
      place.add(body.group);
      this.scene.add(place);
      return { place, body };
    });
    this.theme();
  }

  theme() {
    this.scene.background = new Color(getComputedStyle(document.documentElement).getPropertyValue("--sky").trim());
  }

  // azimuth: where the view's camera stands.
  draw(motion, azimuth) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!motion || !motion.count || !width) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    const across = Math.max(POSES * SPACING_M, (HEIGHT_M * width) / height);
    const up = (across * height) / width;
    Object.assign(this.camera, { left: -across / 2, right: across / 2, top: up - 0.12, bottom: -0.12 });
    this.camera.position.set(0, -8, 0);
    this.camera.lookAt(0, 0, 0);
    this.camera.updateProjectionMatrix();
    this.places.forEach(({ place, body }, i) => {
      const frame = Math.min(Math.round((i * (motion.total - 1)) / (POSES - 1)), motion.count - 1);
      const values = motion.pose(frame);
      body.pose(values);
      const level = motion.ground ? heightAt(motion.ground, values[0], values[1]) : 0;
      body.group.position.set(-values[0], -values[1], -level);
      place.rotation.z = -azimuth - Math.PI / 2;
      place.position.x = BEFORE_M - across / 2 + (i / (POSES - 1)) * (across - BEFORE_M - AFTER_M);
      body.group.visible = true;
    });
    this.renderer.render(this.scene, this.camera);
  }
}
