// Projects in the browser's lasting storage (IndexedDB), each in a record of its own, and a list of their
// names. A record counts how often it was stored: whoever finds another number than the last one seen
// here (another tab was there) stores a copy instead, so that neither loses anything.

import { checked, copyOf } from "./project.js";

/** @import { Project } from "./types.js" */

/** @typedef {{ id: string, name: string, saved: number, removed?: number }} Listed removed: when (ms since 1970), if it was */

export const KEPT_DAYS = 14; // after a project was removed
const DAY_MS = 86_400_000;
const NAME = "getup-edit", PROJECTS = "projects", LIST = "list";

export class Storage {
  /** Whether what is stored outlives the page; false where the browser forbids it. */
  get lasting() { return this.database !== null; }

  constructor() {
    /** @type {IDBDatabase | null} */
    this.database = null;
    /** @type {Map<string, Project>} */
    this.memory = new Map();
    /** @type {Map<string, number>} when those of the memory were removed */
    this.removed = new Map();
    this.kept = false; // asked to be
  }

  async open() {
    try {
      const request = indexedDB.open(NAME, 1);
      request.onupgradeneeded = () => {
        request.result.createObjectStore(PROJECTS, { keyPath: "id" });
        request.result.createObjectStore(LIST, { keyPath: "id" });
      };
      this.database = await done(request);
      this.database.onversionchange = () => this.database?.close();
    } catch { this.database = null; }
    await this.forget(Date.now() - KEPT_DAYS * DAY_MS).catch(() => {}); // the next time, then
  }

  /** The newest first, also those that were removed. @returns {Promise<Listed[]>} */
  async list() {
    if (!this.database) return [...this.memory.values()].map(({ id, name, saved }) => ({ id, name, saved, removed: this.removed.get(id) }));
    const listed = /** @type {Listed[]} */ (await done(this.database.transaction(LIST).objectStore(LIST).getAll()));
    return listed.sort((a, b) => b.saved - a.saved);
  }

  /** null where there is none; an Error where it cannot be read. @param {string} id @returns {Promise<Project | null>} */
  async read(id) {
    const found = this.database ? await done(this.database.transaction(PROJECTS).objectStore(PROJECTS).get(id)) : this.memory.get(id);
    try { return found ? checked(found) : null; } catch (error) {
      throw new Error(`“${found.name}” cannot be read: ${/** @type {Error} */ (error).message}`);
    }
  }

  /** Stores a project; gives it as it is stored now: one revision later, or a copy. @param {Project} project @returns {Promise<Project>} */
  async write(project) {
    const stored = { ...project, revision: project.revision + 1, saved: Date.now() };
    if (!this.database) {
      this.memory.set(stored.id, stored);
      this.removed.delete(stored.id);
      return stored;
    }
    const transaction = this.database.transaction([PROJECTS, LIST], "readwrite");
    const projects = transaction.objectStore(PROJECTS);
    const there = await done(projects.get(project.id));
    const other = there && there.revision !== project.revision;
    const written = other ? { ...copyOf(stored, `${project.name.slice(0, 90)} (copy)`), revision: 1 } : stored;
    projects.put(written);
    if (project.variants.some((one) => one.history.past.length)) this.keep(); // something was edited
    const { id, name, saved } = written;
    transaction.objectStore(LIST).put({ id, name, saved });
    await whole(transaction);
    return written;
  }

  /** Once: that the browser does not make room by forgetting. It may ask the user, or say no. */
  keep() {
    if (this.kept) return;
    this.kept = true;
    navigator.storage?.persist?.().catch(() => {});
  }

  /** A project that is removed stays for some days, and can be put back; one that is stored again is no longer removed. @param {string} id */
  remove(id) { return this.mark(id, Date.now()); }

  /** @param {string} id */
  putBack(id) { return this.mark(id, undefined); }

  /** @param {string} id @param {number | undefined} removed */
  async mark(id, removed) {
    if (removed) this.removed.set(id, removed);
    else this.removed.delete(id);
    if (!this.database) return;
    const transaction = this.database.transaction(LIST, "readwrite"), list = transaction.objectStore(LIST), listed = await done(list.get(id));
    if (listed) list.put({ ...listed, removed });
    await whole(transaction);
  }

  /** For good, those that were removed until then; gives how many. @param {number} until ms since 1970 */
  async forget(until) {
    const old = (await this.list()).filter(({ removed }) => removed && removed <= until).map(({ id }) => id);
    for (const id of old) this.memory.delete(id);
    if (!this.database || !old.length) return old.length;
    const transaction = this.database.transaction([PROJECTS, LIST], "readwrite");
    for (const id of old) for (const name of [PROJECTS, LIST]) transaction.objectStore(name).delete(id);
    await whole(transaction);
    return old.length;
  }
}

/** @param {IDBTransaction} transaction @returns {Promise<void>} */
function whole(transaction) {
  return new Promise((resolve, reject) => {
    transaction.oncomplete = () => resolve();
    transaction.onabort = transaction.onerror = () => reject(transaction.error);
  });
}

/** @template T @param {IDBRequest<T>} request @returns {Promise<T>} */
function done(request) {
  return new Promise((resolve, reject) => {
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error);
  });
}
