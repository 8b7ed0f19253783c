// Words that the browser keeps beside the projects. Where it is told to keep nothing, even to name its
// storage is an error: then nothing is remembered, and the page goes on.

/** @typedef {"localStorage" | "sessionStorage"} Where of all pages, or of this tab */

/** @param {Where} where @param {string} key @returns {string | null} */
export function recalled(where, key) {
  try { return globalThis[where].getItem(key); } catch { return null; }
}

/** @param {Where} where @param {string} key @param {string} text */
export function remember(where, key, text) {
  try { globalThis[where].setItem(key, text); } catch { /* not kept: the page says of its projects what that means */ }
}
