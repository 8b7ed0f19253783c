// How long an edit takes until it is on the screen: from the end of the gesture, by the time stamp of
// its event, to the moment at which the browser and its renderer have drawn the frames.

const SOON_MS = 300; // after the end of a gesture, its first frames are about to come

export class Latency {
  /** @param {(first: number, whole: number | null) => void} report milliseconds; whole is null until the whole motion is drawn */
  constructor(report) {
    this.report = report;
    /** @type {any} */
    this.request = null;
    /** @type {number | null} */
    this.first = null;
    /** @type {Set<string>} */
    this.due = new Set();
  }

  /** A gesture ended; what an older one still waits for is no longer measured. @param {any} request */
  begin(request) { Object.assign(this, { request, first: null, due: new Set() }); }

  // "first" or "whole" has come and is to be drawn.
  came(request, what) {
    if (request !== this.request) return;
    this.due.add(what);
    performance.mark(`getup: ${what} came`);
  }

  get waits() { return this.due.size > 0; }

  // The first frames of an edit are about to come, or are being drawn.
  get expects() {
    return this.request !== null && this.first === null && !this.waits && performance.now() - this.request.released < SOON_MS;
  }

  // Curves and picture are given to the browser and its renderer: they are on the screen after the
  // next animation frame and once the renderer, which works beside the page, is done.
  drawn(fence) {
    const { request, due } = this;
    this.due = new Set();
    const end = () => this.end(request, due);
    let open = fence ? 2 : 1;
    const close = () => { if (--open === 0) end(); };
    requestAnimationFrame(() => setTimeout(close, 0));
    fence?.then(close);
  }

  end(request, due) {
    if (request !== this.request) return;
    const now = performance.now(), took = now - request.released;
    for (const what of due) performance.measure(`getup: ${what} drawn`, { start: request.released, end: now });
    if (due.has("first")) this.first = took;
    if (this.first !== null) this.report(this.first, due.has("whole") ? took : null);
  }
}
