import assert from "node:assert/strict";
import { test } from "node:test";

import { curve } from "./samples.js";
import { Autosave } from "../../../src/getup_jax/editor/page/autosave.js";
import { last } from "../../../src/getup_jax/editor/page/edits.js";
import { copyOf, project } from "../../../src/getup_jax/editor/page/project.js";
import { Storage } from "../../../src/getup_jax/editor/page/storage.js";
import { Store } from "../../../src/getup_jax/editor/page/store.js";

/** A browser's storage of tabs that share it. */
class Shared {
  constructor() {
    this.lasting = true;
    this.projects = new Map();
    this.writes = 0;
  }

  async write(one) {
    this.writes += 1;
    await null;
    const there = this.projects.get(one.id), next = { ...one, revision: one.revision + 1, saved: 1 };
    const written = there && there.revision !== one.revision ? { ...copyOf(next, `${one.name} (copy)`), revision: 1 } : next;
    this.projects.set(written.id, written);
    return written;
  }
}

const closing = []; // what listens to the closing of the page
globalThis.addEventListener = (_, listener) => closing.push(listener);
globalThis.document ??= /** @type {any} */ ({ body: { dataset: {} } });

function tab(storage) {
  const store = new Store(), said = [], autosave = new Autosave(storage, store, (text) => said.push(text));
  store.addEventListener("change", ({ detail }) => { if (detail.kind !== "live") autosave.save(); });
  return { store, autosave, said };
}
const seconds = (one) => one.variants[0].history.now.curve.durations[0];

test("every finished edit is stored, also one that is made while another is being stored", async () => {
  const storage = new Shared(), { store, autosave } = tab(storage);
  await autosave.open(project(curve(), "p"), true);
  store.commit((now) => last(now, 5));
  store.commit((now) => last(now, 6));
  await autosave.save();
  const [stored] = storage.projects.values();
  assert.equal(seconds(stored), 6);
  assert.equal(stored.revision, store.project.revision);
});

test("who closes the page is warned until the last edit is stored", async () => {
  const { store, autosave } = tab(new Shared()), warns = closing.at(-1);
  const warned = () => {
    const event = new Event("beforeunload", { cancelable: true });
    warns(event);
    return event.defaultPrevented;
  };
  await autosave.open(project(curve(), "p"), true);
  assert.equal(warned(), false);
  store.commit((now) => last(now, 8));
  assert.ok(warned());
  await autosave.writing;
  assert.equal(warned(), false);
});

test("to open a project, and to look at a variant anew, stores nothing", async () => {
  const storage = new Shared(), { store, autosave } = tab(storage);
  await autosave.open(project(curve(), "p"), false);
  store.tell("show");
  await autosave.save();
  assert.equal(storage.writes, 0);
});

test("two tabs of one project become two projects, each with its own edits", async () => {
  const storage = new Shared(), one = tab(storage), two = tab(storage);
  await one.autosave.open(project(curve(), "p"), true);
  await two.autosave.open([...storage.projects.values()][0], false);
  one.store.commit((now) => last(now, 5));
  await one.autosave.save();
  two.store.commit((now) => last(now, 9));
  await two.autosave.save();
  assert.deepEqual([...storage.projects.values()].map(seconds), [5, 9]);
  assert.equal(two.store.project.name, "p (copy)");
  assert.equal(two.said.length, 1);
  one.store.commit((now) => last(now, 6));
  await one.autosave.save();
  assert.deepEqual([...storage.projects.values()].map(seconds), [6, 9]);
});

test("what the browser does not store is said, and tried again with the next edit", async () => {
  const storage = new Shared(), { store, autosave, said } = tab(storage);
  const { write } = storage;
  storage.write = () => Promise.reject(new Error("full"));
  await autosave.open(project(curve(), "p"), true);
  assert.match(said[0], /did not store the project \(full\); export it/);
  assert.ok(autosave.failed);
  storage.write = write;
  store.commit((now) => last(now, 5));
  await autosave.save();
  assert.ok(!autosave.failed);
});

test("a storage that cannot be read is said, and opens nothing", async () => {
  const storage = new Shared(), { autosave, said } = tab(storage);
  storage.list = () => Promise.reject(new Error("broken"));
  assert.equal(await autosave.last(), null);
  assert.match(said.join(), /storage: broken/);
});

test("a project that cannot be read is said, and the next one is opened", async () => {
  const storage = new Shared(), { autosave, said } = tab(storage), good = project(curve(), "good");
  storage.list = async () => [{ id: "bad" }, { id: good.id }];
  storage.read = async (id) => { if (id === "bad") throw new Error("“odd” cannot be read: keys"); return good; };
  assert.equal(await autosave.last(), good);
  assert.match(said.join(), /“odd” cannot be read/);
});

test("a project that was removed is not opened by itself, and stays removed", async () => {
  const storage = new Storage(), { autosave } = tab(storage), one = project(curve(), "one"), two = project(curve(), "two");
  await storage.open(); // Node has no database: the memory stands for it
  await storage.write(one);
  await storage.write(two);
  await storage.remove(two.id);
  assert.equal((await autosave.last()).name, "one");
  await storage.remove(one.id);
  assert.equal(await autosave.last(), null);
});

test("a removed project can be put back until it is forgotten; to store it again puts it back, too", async () => {
  const storage = new Storage(), one = project(curve(), "one"), listed = async () => (await storage.list()).map(({ removed }) => Boolean(removed));
  await storage.open();
  const stored = await storage.write(one);
  await storage.remove(one.id);
  assert.deepEqual(await listed(), [true]);
  assert.equal(await storage.forget(Date.now() - 1000), 0, "it was removed later");
  await storage.putBack(one.id);
  assert.deepEqual(await listed(), [false]);
  assert.equal((await storage.read(one.id)).name, "one");
  await storage.remove(one.id);
  await storage.write(stored);
  assert.deepEqual(await listed(), [false]);
  await storage.remove(one.id);
  assert.equal(await storage.forget(Date.now()), 1);
  assert.deepEqual(await listed(), []);
});
