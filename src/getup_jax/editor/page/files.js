// Saving, opening and importing; several files wait for each other.

import { $, download } from "./dom.js";
import { say } from "./notice.js";

/** @import { Curve, Recording } from "./types.js" */

const MOST_REASONS = 3; // that one line has room for

export class Files {
  /** @param {import("./link.js").Link} link @param {import("./store.js").Store} store @param {{ opened: (curves: Curve[], file: string) => void, imported: (curves: Curve[], recordings: (Recording | null)[], file: string) => void, project: (text: string, file: string) => void, ground: () => { region?: string, place?: number } }} to ground: the curve's region and place, for its file */
  constructor(link, store, to) {
    this.link = link;
    this.store = store;
    this.to = to;
    this.queue = Promise.resolve();
    this.left = 0; // files to be read
    this.projects = 0; // that were opened: a motion stays out of one that was opened after it was chosen
    store.addEventListener("change", (/** @type {any} */ { detail }) => { if (detail.kind === "project") this.projects += 1; });
    /** @type {string[]} */
    this.refused = []; // why, of the files that are read one after the other
    this.batch = 0; // a cancelled one's files are not read
    /** @type {number | null} the import under way */
    this.number = null;
    $("save").addEventListener("click", () => this.save());
    $("open").addEventListener("click", () => $("file-curve").click());
    $("import").addEventListener("click", () => $("file-motion").click());
    for (const input of [$("file-curve"), $("file-motion"), $("file-project")]) {
      input.addEventListener("change", () => {
        this.take([...input.files]);
        input.value = "";
      });
    }
    document.addEventListener("dragover", (event) => event.preventDefault());
    document.addEventListener("drop", (event) => {
      event.preventDefault();
      this.take([...(event.dataTransfer?.files ?? [])]);
    });
  }

  async save() {
    const { curve } = this.store.now, name = this.store.fileName(`${curve.name}.yaml`);
    try {
      const file = await this.link.ask({ type: "save", curve: { ...curve, ...this.to.ground() } });
      download(name, file.payload);
      say(`${name} saved`);
    } catch (error) { say(/** @type {Error} */ (error).message, true); }
  }

  /** One after the other, however many are given and whenever. @param {File[]} files */
  take(files) {
    const { projects, batch } = this;
    this.left += files.length;
    for (const file of files) {
      const read = this.queue.then(() => (batch === this.batch ? this.read(file, projects) : undefined));
      this.queue = read.catch((error) => { this.refused.push(error.message); }).then(() => this.done());
    }
  }

  /** What was refused is said when all are read, so that the next file's words do not hide it. */
  done() {
    this.left -= 1;
    if (this.left) return;
    if (this.refused.length) say(refusals(this.refused), true);
    this.refused = [];
  }

  /** Ends the import under way, and leaves out the files that wait for it. */
  cancel() {
    this.batch += 1;
    if (this.number !== null) this.link.send({ type: "cancel", of: this.number });
  }

  /** @param {File} file @param {number} projects opened when it was chosen */
  async read(file, projects) {
    const name = file.name.replace(/[^\p{L}\p{M}\p{N}_ ().+-]/gu, "_").replace(/^\.+/, "").slice(-100);
    if (/\.getup\.json$/i.test(file.name)) return this.to.project(await file.text(), file.name);
    if (/\.ya?ml$/i.test(file.name)) {
      const answer = await this.link.ask({ type: "load", name, text: await file.text() });
      return this.to.opened(answer.curves, file.name);
    }
    const another = () => {
      if (projects !== this.projects) throw new Error(`${file.name}: not imported, since another project was opened meanwhile; import it anew.`);
    };
    another();
    const bytes = await file.arrayBuffer(), { batch } = this;
    say(`Reading ${file.name} …${this.left > 1 ? ` (${this.left - 1} more)` : ""}`, false, { words: "Cancel", act: () => this.cancel() }, true);
    const answer = await this.asked(name, bytes).catch((error) => {
      throw batch === this.batch ? error : new Error(`${file.name}: ${this.left > 1 ? `not imported, nor the ${this.left - 1} after it` : "not imported"}: cancelled`);
    });
    another();
    return this.to.imported(answer.curves, recordings(answer), file.name);
  }

  /** The answer to an import, which can be cancelled until it is there. @param {string} name @param {ArrayBuffer} bytes */
  async asked(name, bytes) {
    const answer = this.link.ask({ type: "import", name }, bytes);
    this.number = this.link.number;
    try {
      return await answer;
    } finally { this.number = null; }
  }
}

/** One line on all that was refused. @param {string[]} reasons */
export function refusals(reasons) {
  const more = reasons.length > MOST_REASONS ? ` · and ${reasons.length - MOST_REASONS} more` : "";
  const count = reasons.length > 1 ? `${reasons.length} files were refused. ` : "";
  return `${count}${reasons.slice(0, MOST_REASONS).join(" · ")}${more}`;
}

/** The motions behind the curves, which follow each other in the payload. @param {any} answer @returns {(Recording | null)[]} */
export function recordings({ recordings: heads = [], payload }) {
  let at = 0;
  return heads.map((/** @type {any} */ { fps, total, links }) => {
    const size = total * (links * 7 + 3), frames = new Float32Array(payload.slice(4 * at, 4 * (at + size)));
    at += size;
    return { fps, total, links, frames };
  });
}
