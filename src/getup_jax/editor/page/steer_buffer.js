// The frames that have come and are not shown yet: a few, and each of them for one control step.

/** @typedef {{ number: number, payload: ArrayBuffer, [said: string]: any }} Frame */

const WINDOW_S = 1; // over which the pace is measured

export class Buffer {
  /** @param {number} step s, of a frame */
  constructor(step) {
    this.step = step;
    /** @type {Frame[]} */
    this.frames = [];
    this.due = 0; // s since the frame on the screen
    this.played = 0;
    this.passed = 0;
    /** Of the speed that was asked for. */
    this.pace = 1;
  }

  /** @param {Frame} frame */
  add(frame) { this.frames.push(frame); }

  clear() { Object.assign(this, { frames: [], due: 0, played: 0, passed: 0, pace: 1 }); }

  /** The frame that is due after so much time, null: the one on the screen still is. @param {number} seconds of the simulation */
  advance(seconds) {
    this.due += seconds;
    /** @type {Frame | null} */
    let shown = null;
    while (this.due >= this.step && this.frames.length) {
      shown = /** @type {Frame} */ (this.frames.shift());
      this.due -= this.step;
      this.played += this.step;
    }
    this.due = Math.min(this.due, this.step); // what comes late is not caught up with
    this.measure(seconds);
    return shown;
  }

  /** @param {number} seconds */
  measure(seconds) {
    this.passed += seconds;
    if (this.passed < WINDOW_S) return;
    this.pace = Math.min(1, this.played / this.passed);
    this.played = this.passed = 0;
  }
}
