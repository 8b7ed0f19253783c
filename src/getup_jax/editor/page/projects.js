// The dialog of projects: open, name, copy, remove and put back, export to a file and import.

import { $, download, el } from "./dom.js";
import { say } from "./notice.js";
import { KEPT_DAYS } from "./storage.js";
import { copyOf, fromText, project, SUFFIX, toText } from "./project.js";

/** @import { Curve, Project } from "./types.js" */

export class Projects {
  /** @param {import("./storage.js").Storage} storage @param {import("./store.js").Store} store @param {import("./autosave.js").Autosave} autosave @param {() => Curve} firstCurve */
  constructor(storage, store, autosave, firstCurve) {
    this.storage = storage;
    this.store = store;
    this.autosave = autosave;
    this.firstCurve = firstCurve;
    $("project").addEventListener("click", () => this.show());
  }

  get own() { return /** @type {Project} */ (this.store.project); }

  async show() {
    await this.autosave.writing;
    const listed = (await this.autosave.tried(() => this.storage.list())) ?? [], dialog = $("dialog");
    const gone = listed.filter((one) => one.removed);
    const rename = (/** @type {Event} */ event) => this.rename(/** @type {HTMLInputElement} */ (event.target));
    dialog.replaceChildren(
      el("h2", { id: "dialog-title" }, "Projects"),
      el("p", { class: "note" }, this.storage.lasting
        ? "Kept in this browser, with variants, undo, ground and imports. Export one to keep it elsewhere."
        : "This browser keeps nothing: export the project before you close the page."),
      el("label", {}, "This project ", el("input", { id: "project-name", maxlength: 100, ".value": this.own.name, onchange: rename })),
      el("ul", { id: "project-list" }, ...listed.filter((one) => !one.removed).map((one) => this.row(one))),
      ...(gone.length ? this.removedRows(gone) : []),
      el("p", { class: "buttons" },
        el("button", { id: "project-new", onclick: () => this.begin() }, "New"),
        el("button", { id: "project-copy", onclick: () => this.open(copyOf(this.own, `${this.own.name.slice(0, 90)} (copy)`)) }, "Copy"),
        el("button", { id: "project-export", onclick: () => this.export() }, "Export to a file"),
        el("button", { id: "project-import", onclick: () => $("file-project").click() }, "Import"),
        el("button", { onclick: () => dialog.close() }, "Close")),
    );
    if (!dialog.open) dialog.showModal();
  }

  /** @param {import("./storage.js").Listed} one */
  row({ id, name, saved }) {
    const open = el("button", { class: "wide", "aria-current": id === this.own.id ? "true" : "false", onclick: () => this.load(id) },
      el("b", {}, name), el("small", {}, new Date(saved).toLocaleString()));
    const remove = el("button", { title: "Remove", "aria-label": `Remove ${name}`, disabled: id === this.own.id, onclick: () => this.remove(id, name) }, "×");
    return el("li", {}, open, remove);
  }

  /** Those that were removed, and a way to be rid of them before their time. @param {import("./storage.js").Listed[]} gone */
  removedRows(gone) {
    const row = (/** @type {import("./storage.js").Listed} */ { id, name, removed }) => el("li", {},
      el("span", { class: "wide" }, name, el("small", {}, `removed ${new Date(removed ?? 0).toLocaleString()}`)),
      el("button", { "aria-label": `Put back ${name}`, onclick: () => this.putBack(id) }, "Put back"));
    return [
      el("p", { class: "note" }, `Removed, kept for ${KEPT_DAYS} days `, el("button", { id: "removed-forget", onclick: () => this.forget(gone.length) }, "Delete them")),
      el("ul", { id: "removed-list" }, ...gone.map(row)),
    ];
  }

  /** @param {string} id */
  async putBack(id) {
    await this.autosave.tried(() => this.storage.putBack(id));
    if ($("dialog").open) await this.show();
  }

  /** @param {number} count */
  forget(count) {
    const act = async () => {
      await this.autosave.tried(() => this.storage.forget(Date.now()));
      await this.show();
    };
    say(`${count === 1 ? "This project is" : `These ${count} projects are`} then gone for good.`, true, { words: "Delete", act });
  }

  /** @param {HTMLInputElement} input */
  rename(input) {
    this.store.rename(input.value.trim().slice(0, 100) || this.own.name);
    input.value = this.own.name;
    this.autosave.save();
  }

  begin() { return this.open(project(this.firstCurve(), freeName(this.own.name))); }

  /** @param {string} id */
  async load(id) {
    await this.autosave.save();
    const found = await this.autosave.tried(() => this.storage.read(id));
    if (found) await this.open(found, false);
  }

  /** @param {Project} opened @param {boolean} fresh not stored yet */
  async open(opened, fresh = true) {
    await this.autosave.save(); // the last edit of the one that is left
    if (!this.autosave.failed) return this.change(opened, fresh);
    const words = `“${this.own.name}” is not stored: export it first, or its last edits are lost.`;
    say(words, true, { words: "Leave it", act: () => this.change(opened, fresh) });
  }

  /** @param {Project} opened @param {boolean} fresh */
  async change(opened, fresh) {
    await this.autosave.open(opened, fresh);
    $("dialog").close();
    say(`Project “${this.own.name}”`);
  }

  /** @param {string} id @param {string} name */
  async remove(id, name) {
    const removed = await this.autosave.tried(async () => {
      await this.storage.remove(id);
      return true;
    });
    if (!removed) return;
    await this.show();
    say(`Project “${name}” is removed.`, false, { words: "Put it back", act: () => this.putBack(id) });
  }

  export() {
    download(`${this.own.name.replace(/[^\p{L}\p{M}\p{N}_ ().+-]/gu, "_")}${SUFFIX}`, toText(this.own));
    say(`Project “${this.own.name}” exported`);
  }

  /** @param {string} text @param {string} file */
  import(text, file) { return this.open(fromText(text, file)); }
}

/** @param {string} name */
function freeName(name) {
  const number = /^(.*?) (\d+)$/.exec(name);
  return number ? `${number[1]} ${Number(number[2]) + 1}` : "My get-up 2";
}
