// Stores the project after every edit, one writing at a time: the newest wins.

import { recalled, remember } from "./recall.js";

/** @import { Project } from "./types.js" */

const TAB = "getup-edit-project"; // the one that this tab, and the next new one, opens

export class Autosave {
  /** @param {import("./storage.js").Storage} storage @param {import("./store.js").Store} store @param {(text: string, bad?: boolean) => void} say */
  constructor(storage, store, say) {
    this.storage = storage;
    this.store = store;
    this.say = say;
    /** @type {Promise<void> | null} */
    this.writing = null;
    this.due = false;
    this.failed = false;
    /** @type {Project | null} as it was stored or read last */
    this.known = null;
    addEventListener("beforeunload", (event) => {
      if ((this.writing || this.failed || !storage.lasting) && store.project) event.preventDefault();
    });
  }

  /** The project that was open last in this tab, or else in any; null where there is none that can be read. @returns {Promise<Project | null>} */
  async last() {
    const open = [recalled("sessionStorage", TAB), recalled("localStorage", TAB)];
    const listed = await this.tried(() => this.storage.list());
    const removed = new Set((listed ?? []).filter((one) => one.removed).map((one) => one.id));
    for (const id of new Set([...open, ...(listed ?? []).map((one) => one.id)])) {
      const found = id && !removed.has(id) && (await this.tried(() => this.storage.read(id)));
      if (found) return found;
    }
    return null;
  }

  /** null, and a word on it, where the storage fails. @template T @param {() => Promise<T>} act @returns {Promise<T | null>} */
  async tried(act) {
    try { return await act(); } catch (error) {
      this.say(`From the browser's storage: ${/** @type {Error} */ (error).message}.`, true);
      return null;
    }
  }

  /** Opens a project; one that is stored already is not stored anew, since another tab may have it too. @param {Project} project @param {boolean} fresh */
  open(project, fresh) {
    this.known = fresh ? null : project;
    this.failed = false;
    this.store.open(project);
    rememberOpen(project.id);
    return fresh ? this.save() : Promise.resolve();
  }

  /** Soon stored; what is edited meanwhile is stored after it. */
  save() {
    if (this.store.project === this.known) return this.writing ?? Promise.resolve();
    this.due = true;
    this.writing ??= this.work().finally(() => { this.writing = null; });
    return this.writing;
  }

  async work() {
    while (this.due) {
      this.due = false;
      const project = /** @type {Project} */ (this.store.project);
      try {
        const written = await this.storage.write(project);
        this.failed = false;
        this.stored(project, written);
      } catch (error) {
        this.failed = true;
        this.say(`The browser did not store the project (${/** @type {Error} */ (error).message}); export it to keep it.`, true);
      }
    }
  }

  /** @param {Project} project @param {Project} written */
  stored(project, written) {
    if (this.store.project?.id !== project.id) return; // another one was opened meanwhile
    const { id, name, revision, saved } = written, newest = this.store.project === project;
    this.store.change({ id, revision, saved, name: id === project.id ? this.store.project.name : name });
    if (newest) this.known = this.store.project;
    rememberOpen(id);
    document.body.dataset.saved = String(revision);
    if (id !== project.id) {
      this.say(`“${project.name}” was changed in another tab; yours goes on as “${name}”.`, true);
      this.store.tell("show");
    }
  }
}

/** @param {string} id */
function rememberOpen(id) {
  remember("sessionStorage", TAB, id);
  remember("localStorage", TAB, id);
}
