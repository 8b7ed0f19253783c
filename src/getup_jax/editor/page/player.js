// Time: play, pause, scrub, speed, and which frame is shown.

const REST_S = 0.7; // the last pose stays this long before a loop begins again

export class Player {
  constructor(elements, model, onFrame) {
    Object.assign(this, { elements, model, onFrame, time: 0, playing: true, rest: 0 });
    const { play, scrub } = elements;
    play.addEventListener("click", () => this.toggle());
    scrub.addEventListener("input", () => this.seek(Number(scrub.value) * this.model.span()));
    this.last = performance.now();
    const tick = (now) => {
      this.advance((now - this.last) / 1000);
      this.last = now;
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  toggle(playing = !this.playing) {
    if (playing && this.time >= this.model.span() - 1e-3) this.time = 0;
    this.playing = playing;
    this.shown = null; // the clock says where exactly it stopped
    this.elements.play.textContent = playing ? "❚❚" : "▶";
  }

  seek(time) {
    this.toggle(false);
    this.time = Math.min(Math.max(time, 0), this.model.span());
  }

  restart() {
    if (this.playing) this.time = 0;
    this.rest = 0;
  }

  advance(seconds) {
    if (this.playing) {
      this.time += Math.min(seconds, 0.2) * Number(this.elements.speed.value);
      if (this.time >= this.model.span()) {
        this.time = this.model.span();
        this.rest += seconds;
        if (this.rest > REST_S) {
          this.rest = 0;
          if (this.elements.loop.checked) this.time = 0;
          else this.toggle(false);
        }
      }
    }
    this.show();
    this.onFrame();
  }

  // Words and lines change with the motion's frames, not with those of the screen.
  show() {
    const { scrub, clock } = this.elements, step = this.model.controlDt || 0.01;
    const shown = `${Math.round(this.time / step)} of ${this.model.span()}`;
    this.moved = shown !== this.shown;
    if (!this.moved) return;
    this.shown = shown;
    scrub.value = this.time / Math.max(this.model.span(), 1e-6);
    clock.textContent = `${this.time.toFixed(2)} s`;
  }

  // The frame of a motion at this time, as far as it has arrived.
  frame(motion, controlDt) {
    return Math.min(Math.max(Math.round(this.time / controlDt) - 1, 0), motion.count - 1);
  }
}
