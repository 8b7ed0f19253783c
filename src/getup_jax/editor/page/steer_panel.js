// Beside the view: the policies, what the character is told, and how that goes.

import { $, el, write } from "./dom.js";
import { title, words } from "./steer_goals.js";

/** @typedef {import("./steer_goals.js").Goal} Goal */
/** @typedef {{ name: string, ready: boolean, steps: number, goals: Record<string, Goal> }} Policy */

/** Numbers of an order that have a slider: least, most, step, unit. @type {Record<string, [number, number, number, string]>} */
const SLIDERS = { yaw_deg: [-180, 180, 1, "°"], pitch_deg: [-60, 60, 1, "°"], speed: [0, 0, 0.05, " m/s"] };
/** @type {Record<string, string>} */
const LABELS = { yaw_deg: "Turn", pitch_deg: "Up", speed: "Speed" };

export class Panel {
  /** @param {{ policy: (name: string) => void, order: (goal: string, order: object) => void }} acts */
  constructor(acts) {
    this.acts = acts;
    /** @type {Policy[]} */
    this.policies = [];
    this.acting = "";
    /** @type {Map<string, any>} elements of each goal */
    this.cards = new Map();
  }

  /** @param {Policy[]} policies */
  fill(policies) {
    this.policies = policies;
    $("policies").replaceChildren(...policies.map(({ name, ready, steps }, i) => el("button", {
      class: ready ? "" : "later", onclick: () => this.acts.policy(name), "aria-pressed": String(name === this.acting),
      title: `${name}: ${(steps / 1e6).toFixed(1)} M samples of training${i < 9 ? ` (${i + 1})` : ""}${ready ? "" : "; it is compiled first, which takes a while"}`,
    }, name)));
  }

  /** @returns {Record<string, Goal>} */
  get goals() { return this.policies.find(({ name }) => name === this.acting)?.goals ?? {}; }

  /** @param {import("./steer_buffer.js").Frame} frame @param {number[]} body where it is */
  show(frame, body) {
    if (frame.policy !== this.acting) this.begin(frame.policy);
    const [main, note] = said(frame);
    write($("doing"), main);
    write($("happened"), note);
    $("state").className = frame.phase === "acts" ? "" : "bad";
    for (const [name, card] of this.cards) this.update(card, frame.goals[name], body);
  }

  /** Another policy acts, with other goals. @param {string} name */
  begin(name) {
    this.acting = name;
    this.fill(this.policies);
    this.cards = new Map(Object.entries(this.goals).map(([goal, settings]) => [goal, this.card(goal, settings)]));
    const none = el("section", { class: "goal" }, el("p", {}, "This policy imitates and has no goal: there is nothing to tell it."));
    $("goals").replaceChildren(...(this.cards.size ? [...this.cards.values()].map((card) => card.all) : [none]));
  }

  /** @param {string} goal @param {Goal} settings */
  card(goal, settings) {
    const told = el("p"), value = el("span"), bar = el("i");
    /** @type {Record<string, any>} */
    const sliders = {};
    const send = () => this.acts.order(goal, Object.fromEntries(Object.entries(sliders).map(([key, { input }]) => [key, Number(input.value)])));
    for (const key of Object.keys(SLIDERS).filter((number) => number in settings.orders)) {
      const [least, most, step, unit] = SLIDERS[key], [low, high] = key === "speed" ? settings.speed ?? [0, 2] : [least, most];
      const input = el("input", { type: "range", min: low, max: high, step, ".value": (low + high) / 2, oninput: send, "aria-label": `${title(goal)}: ${LABELS[key]}` });
      sliders[key] = { input, output: el("output"), unit };
    }
    const rows = Object.entries(sliders).map(([key, { input, output }]) => el("label", {}, el("span", {}, LABELS[key]), input, output));
    const all = el("section", { class: "goal", "data-goal": goal }, el("h2", {}, title(goal), value), told, el("div", { class: "bar", title: "Reward now, 0 to 1" }, bar), ...rows);
    return { all, told, value, bar, sliders };
  }

  /** @param {any} card @param {any} goal @param {number[]} body */
  update(card, goal, body) {
    if (!goal) return;
    const reached = goal.told?.reached_after_s ?? null;
    write(card.told, words(goal.told, body));
    card.told.className = reached === null ? "" : "reached";
    write(card.value, goal.reward === null ? "" : goal.reward.toFixed(2));
    card.bar.style.width = `${100 * Math.min(Math.max(goal.reward ?? 0, 0), 1)}%`;
    for (const [key, { input, output, unit }] of Object.entries(card.sliders)) {
      const now = goal.told?.order[key];
      if (typeof now === "number" && document.activeElement !== input) input.value = now;
      write(output, typeof now === "number" ? `${now.toFixed(key === "speed" ? 1 : 0)}${unit}` : "–");
    }
  }
}

/** Who acts, and what happened. @param {import("./steer_buffer.js").Frame} frame @returns {[string, string]} */
function said({ phase, policy, words: happened, falls, on_feet_in_s: left }) {
  const count = falls ? `${falls} fall${falls > 1 ? "s" : ""} so far` : "";
  if (phase === "acts") return [`${policy} acts`, [happened, count].filter(Boolean).join(" · ")];
  if (phase === "rises") return ["It gets up by itself", count];
  const next = left === null ? "it gets up by itself in a moment" : `put back on its feet in ${left.toFixed(1)} s`;
  return [`${happened}: ${next}`, count];
}
