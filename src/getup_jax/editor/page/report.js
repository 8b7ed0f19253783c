// The words below the strip: verdict, tracking errors, warnings, and how long the last edit took.

const LONG = 60; // letters of a verdict that needs smaller ones
const DEGREES = 180 / Math.PI;

/** @import { Result } from "./types.js" */

/**
 * What is said of a variant: of its result where that is what is edited now, else what it waits for.
 * @param {Result | undefined} result @param {boolean} current @param {boolean} connected
 * @returns {{ words: string, mood: "good" | "near" | "bad" | "" }} near: it stands, but not as the curves say
 */
export function verdictOf(result, current, connected) {
  if (!result || !current) return { words: connected ? "Simulating …" : "Not simulated: no connection", mood: "" };
  if (result.error) return { words: `Not simulated: ${result.error}`, mood: "bad" };
  if (!result.verdict) return { words: "Simulating …", mood: "" };
  const words = result.verdict.verdict;
  return { words: words[0].toUpperCase() + words.slice(1), mood: MOODS[signOf(result.verdict)] };
}

/** @type {Record<string, "good" | "near" | "bad">} */
const MOODS = { "✓": "good", "≈": "near", "✗": "bad" };

/** How an episode went, in one sign: ≈ where the body stands though it was too far from the curves. @param {{ success: boolean, stands: boolean }} verdict */
export function signOf({ success, stands }) { return success ? "✓" : stands ? "≈" : "✗"; }

/** @param {any} verdict @param {number} matchDeg */
export function scoresOf(verdict, matchDeg) {
  const s = verdict.scores;
  const parts = [
    `height error ${number(s.height_error_m, 3)} m`,
    `angle error ${number(s.angle_error_rad === null ? null : s.angle_error_rad * DEGREES, 1)}°`,
    `return rate ${number(s.return_rate, 2)}`,
    `energy ${number(s.energy_j, 0)} J`,
    `jitter ${number(s.jitter, 0)} rad/s³`,
  ];
  const gap = verdict.start_gap_deg;
  if (gap > matchDeg) parts.unshift(`⚠ the curve starts ${gap.toFixed(0)}° from the start pose (at most ${matchDeg.toFixed(0)}°)`);
  return parts;
}

/** What came of a wish, in a few words. @param {string} name @param {{ reached: string[], missed: string[], others: string[] }} found */
export function wishWords(name, { reached, missed, others }) {
  const also = others.length ? `, but on ${others.join(", ")}` : "";
  if (!missed.length) return `“${name}”: all on the ground (${reached.join(", ")})`;
  return `⚠ “${name}”: not on the ground: ${missed.join(", ")}${reached.length ? `; there: ${reached.join(", ")}` : ""}${also}`;
}

export class Report {
  /** @param {Record<"verdict" | "scores" | "latency", HTMLElement>} elements */
  constructor(elements) {
    this.elements = elements;
    this.shown = "";
  }

  /** @param {Result | undefined} result @param {boolean} current @param {boolean} connected @param {number} matchDeg @param {() => string[]} wishes what came of them */
  show(result, current, connected, matchDeg, wishes) {
    const { words, mood } = verdictOf(result, current, connected);
    const parts = current && result?.verdict ? [...wishes(), ...scoresOf(result.verdict, matchDeg)] : [];
    const shown = [words, mood, ...parts].join("\n");
    if (shown === this.shown) return;
    this.shown = shown;
    const { verdict, scores } = this.elements;
    verdict.textContent = words;
    verdict.className = [mood, words.length > LONG ? "long" : ""].join(" ").trim();
    verdict.title = words;
    scores.replaceChildren(...parts.flatMap((part, i) => [unbroken(i + 1 < parts.length ? `${part} ·` : part), " "]));
  }

  /** An edit is under way. */
  measuring() { Object.assign(this.elements.latency.dataset, { first: "", whole: "" }); }

  /** @param {number} firstMs @param {number | null} wholeMs @param {number} seconds */
  latency(firstMs, wholeMs, seconds) {
    const { latency } = this.elements;
    latency.dataset.first = String(firstMs);
    latency.dataset.whole = String(wholeMs ?? "");
    const whole = wholeMs === null ? "" : `, all ${seconds.toFixed(1)} s after ${wholeMs.toFixed(0)} ms`;
    latency.textContent = `first new frame after ${firstMs.toFixed(0)} ms${whole}`;
  }
}

/** Words that stay on one line. @param {string} text */
function unbroken(text) {
  const element = document.createElement("span");
  element.textContent = text;
  return element;
}

/** @param {number | null} value @param {number} digits */
function number(value, digits) { return value === null || Number.isNaN(value) ? "–" : value.toFixed(digits); }
