// Projects in the browser's lasting storage (IndexedDB), each in a record of its own, and a list of their
// names. A record counts how often it was stored: whoever finds another number than the last one seen
// here (another tab was there) stores a copy instead, so that neither loses anything.

import { checked, copyOf } from "./project.js";

/** @import { Project } from "./types.js" */

/** @typedef {{ id: string, name: string, saved: number }} Listed */

const NAME = "getup-edit", WHOLE = "projects", LIST = "list";

export class Storage {
  /** Whether what is stored outlives the page; false where the browser forbids it. */
  get lasting() { return this.database !== null; }

  constructor() {
    /** @type {IDBDatabase | null} */
    this.database = null;
    /** @type {Map<string, Project>} */
    this.memory = new Map();
    this.kept = false; // asked to be
  }

  async open() {
    try {
      const request = indexedDB.open(NAME, 1);
      request.onupgradeneeded = () => {
        request.result.createObjectStore(WHOLE, { keyPath: "id" });
        request.result.createObjectStore(LIST, { keyPath: "id" });
      };
      this.database = await done(request);
      this.database.onversionchange = () => this.database?.close();
    } catch { this.database = null; }
  }

  /** The newest first. @returns {Promise<Listed[]>} */
  async list() {
    if (!this.database) return [...this.memory.values()];
    const listed = /** @type {Listed[]} */ (await done(this.database.transaction(LIST).objectStore(LIST).getAll()));
    return listed.sort((a, b) => b.saved - a.saved);
  }

  /** null where there is none; an Error where it cannot be read. @param {string} id @returns {Promise<Project | null>} */
  async read(id) {
    const found = this.database ? await done(this.database.transaction(WHOLE).objectStore(WHOLE).get(id)) : this.memory.get(id);
    try { return found ? checked(found) : null; } catch (error) {
      throw new Error(`“${found.name}” cannot be read: ${/** @type {Error} */ (error).message}`);
    }
  }

  /** Stores a project; gives it as it is stored now: one revision later, or a copy. @param {Project} project @returns {Promise<Project>} */
  async write(project) {
    const stored = { ...project, revision: project.revision + 1, saved: Date.now() };
    if (!this.database) {
      this.memory.set(stored.id, stored);
      return stored;
    }
    const transaction = this.database.transaction([WHOLE, LIST], "readwrite");
    const projects = transaction.objectStore(WHOLE);
    const there = await done(projects.get(project.id));
    const other = there && there.revision !== project.revision;
    const written = other ? { ...copyOf(stored, `${project.name.slice(0, 90)} (copy)`), revision: 1 } : stored;
    projects.put(written);
    if (project.variants.some((one) => one.history.past.length)) this.keep(); // something was edited
    const { id, name, saved } = written;
    transaction.objectStore(LIST).put({ id, name, saved });
    await new Promise((resolve, reject) => {
      transaction.oncomplete = resolve;
      transaction.onabort = transaction.onerror = () => reject(transaction.error);
    });
    return written;
  }

  /** Once: that the browser does not make room by forgetting. It may ask the user, or say no. */
  keep() {
    if (this.kept) return;
    this.kept = true;
    navigator.storage?.persist?.().catch(() => {});
  }

  /** @param {string} id */
  async remove(id) {
    this.memory.delete(id);
    if (!this.database) return;
    const transaction = this.database.transaction([WHOLE, LIST], "readwrite");
    transaction.objectStore(LIST).delete(id);
    await done(transaction.objectStore(WHOLE).delete(id));
  }
}

/** @template T @param {IDBRequest<T>} request @returns {Promise<T>} */
function done(request) {
  return new Promise((resolve, reject) => {
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error);
  });
}
