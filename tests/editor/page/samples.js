// What the unit tests of the page begin with.

import { contentOf } from "../../../src/getup_jax/editor/page/content.js";
import { project } from "../../../src/getup_jax/editor/page/project.js";
import { Store } from "../../../src/getup_jax/editor/page/store.js";

export function curve(changed = {}) {
  return {
    name: "rise", strategy: "other", start: "prone", durations: [4],
    height: [0.11, 0.17, 0.4, 0.53, 0.55, 0.66, 0.92, 1.2, 1.452],
    side_angle: [90, 104, 160, 124, 94, 90, 90, 90, 90],
    front_angle: [179, 168, 150, 166, 170, 146, 114, 114, 90],
    ...changed,
  };
}

export const content = (changed) => contentOf(curve(changed));

export function store() {
  const made = new Store();
  made.open(project(curve(), "test"));
  return made;
}

/** A link that sends nothing and remembers everything. */
export class Wire extends EventTarget {
  constructor() {
    super();
    this.number = 0;
    this.sent = [];
    this.open = true;
  }

  send(request) {
    this.number += 1;
    this.sent.push({ ...request, number: this.number });
    return this.number;
  }

  says(type, detail) { this.dispatchEvent(new CustomEvent(type, { detail: { type, ...detail } })); }

  frames(slot, number, first = 0, count = 2, total = 2) {
    const payload = new Float32Array(count * 11).fill(1).buffer;
    this.says("frames", { slot, number, first, count, total, payload });
  }

  result(slot, number, words = "stands after 2.0 s", success = true, stands = success) {
    this.says("result", { slot, number, verdict: words, success, stands, scores: {}, start_gap_deg: 0 });
  }
}

export function close(found, wanted, within = 1e-9) {
  const far = Math.max(...found.map((value, i) => Math.abs(value - wanted[i])));
  if (!(far <= within) || found.length !== wanted.length) throw new Error(`${found} is ${far} from ${wanted}`);
}
