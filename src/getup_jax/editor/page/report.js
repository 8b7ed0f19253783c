// The words below the strip: verdict, tracking errors, warnings, and how long the last edit took.

const DEGREES = 180 / Math.PI;

export class Report {
  constructor(elements) { this.elements = elements; }

  show(motion, matchDeg) {
    const { verdict, scores } = this.elements;
    const result = motion?.result;
    if (!result) return;
    verdict.textContent = result.verdict[0].toUpperCase() + result.verdict.slice(1);
    verdict.className = result.success ? "good" : "bad";
    const s = result.scores;
    const parts = [
      `height error ${number(s.height_error_m, 3)} m`,
      `angle error ${number(s.angle_error_rad * DEGREES, 1)}°`,
      `return rate ${number(s.return_rate, 2)}`,
      `energy ${number(s.energy_j, 0)} J`,
      `jitter ${number(s.jitter, 0)} rad/s³`,
    ];
    if (result.start_gap_deg > matchDeg) {
      parts.unshift(`⚠ the curve starts ${result.start_gap_deg.toFixed(0)}° from the start pose (at most ${matchDeg.toFixed(0)}°)`);
    }
    scores.replaceChildren(...parts.flatMap((part, i) => [whole(i + 1 < parts.length ? `${part} ·` : part), " "]));
  }

  // An edit is under way.
  measuring() { Object.assign(this.elements.latency.dataset, { first: "", whole: "" }); }

  latency(firstMs, wholeMs, seconds) {
    const { latency } = this.elements;
    latency.dataset.first = firstMs;
    latency.dataset.whole = wholeMs ?? "";
    const whole = wholeMs === null ? "" : `, all ${seconds.toFixed(1)} s after ${wholeMs.toFixed(0)} ms`;
    latency.textContent = `first new frame after ${firstMs.toFixed(0)} ms${whole}`;
  }
}

// Words that stay on one line.
function whole(text) {
  const element = document.createElement("span");
  element.textContent = text;
  return element;
}

function number(value, digits) { return value === null || Number.isNaN(value) ? "–" : value.toFixed(digits); }
