// How long an edit takes until it is on the screen: from the end of the gesture, by the time stamp of
// its event, to the moment at which the browser and its renderer have drawn the frames.

/** @import { Result } from "./types.js" */
/** @typedef {"first" | "whole"} What */

const SOON_MS = 300; // after the end of a gesture, its first frames are about to come

export class Latency {
  /** @param {(first: number, whole: number | null) => void} report milliseconds; whole is null until the whole motion is drawn */
  constructor(report) {
    this.report = report;
    /** @type {Result | null} */
    this.request = null;
    /** @type {number | null} */
    this.first = null;
    /** @type {Set<What>} */
    this.due = new Set();
  }

  /** A gesture ended; what an older one still waits for is no longer measured. @param {Result} request */
  begin(request) { Object.assign(this, { request, first: null, due: new Set() }); }

  /** Something has come and is to be drawn. @param {Result} request @param {What} what */
  came(request, what) {
    if (request !== this.request) return;
    this.due.add(what);
    performance.mark(`getup: ${what} came`);
  }

  get waits() { return this.due.size > 0; }

  // The first frames of an edit are about to come, or are being drawn.
  get expects() {
    return this.request !== null && this.first === null && !this.waits && performance.now() - (this.request.released ?? 0) < SOON_MS;
  }

  /** Curves and picture are given to the browser and its renderer: they are on the screen after the
   * next animation frame and once the renderer, which works beside the page, is done. @param {import("./gpu.js").Fence | undefined} fence */
  drawn(fence) {
    const { request, due } = this;
    this.due = new Set();
    const end = () => this.end(request, due);
    let open = fence ? 2 : 1;
    const close = () => { if (--open === 0) end(); };
    requestAnimationFrame(() => setTimeout(close, 0));
    fence?.then(close);
  }

  /** @param {Result | null} request @param {Set<What>} due */
  end(request, due) {
    if (!request || request !== this.request) return;
    const start = request.released ?? 0, now = performance.now(), took = now - start;
    for (const what of due) performance.measure(`getup: ${what} drawn`, { start, end: now });
    if (due.has("first")) this.first = took;
    if (this.first !== null) this.report(this.first, due.has("whole") ? took : null);
  }
}
