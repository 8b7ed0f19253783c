// The shapes of what the page passes around, for the type checker; there is nothing to run here.

/** @typedef {"height" | "side_angle" | "front_angle"} Feature */
/** @typedef {"auto" | "flat" | "linear"} Kind how a curve passes through a key */
/** @typedef {{ time: number, value: number, kind: Kind }} Key time: share of the duration, 0 to 1 */

/**
 * A curve file's content: nine control points a feature, in metres and degrees.
 * @typedef {object} Curve
 * @property {string} name
 * @property {string} strategy
 * @property {string} start
 * @property {number[]} durations
 * @property {number[]} height
 * @property {number[]} side_angle
 * @property {number[]} front_angle
 * @property {number[]} [pose]
 * @property {string} [region] of irregular ground, in files alone
 * @property {number} [place] there, from 1
 */

/**
 * What undo brings back of a variant. `keys` has the features whose keys differ from those that
 * `keysOf` makes of the control points. Never changed in place.
 * @typedef {object} Content
 * @property {Curve} curve
 * @property {Partial<Record<Feature, Key[]>>} keys
 * @property {Curve} reference what reset goes back to
 * @property {number} region
 * @property {number} place
 * @property {Wish[]} wishes poses that were wished, so that one sees what came of them
 */

/** @typedef {{ name: string, from: number, to: number, contacts: string[] }} Wish from and to: shares of the duration */

/** @typedef {{ now: Content, past: Content[], future: Content[], tag: string, at: number }} History */
/** @typedef {{ slot: number, history: History }} Variant slot: 0 to 3, its letter and its colour for life */

/** @typedef {{ origin: number[], step: number, points: number, heights: number[] }} Ground a piece of a height field: heights (m) row by row on a grid (m) */
/** @typedef {{ link: number, kind: string, size: number[], position: number[], quaternion: number[], colour: number[] }} Shape of the body, as the server describes it */

/** @typedef {{ fps: number, total: number, links: number, frames: Float32Array }} Recording link poses and features of a clip */
/** @typedef {{ curve: Curve, file: string, recording: Recording | null }} Imported */

/**
 * @typedef {object} Project
 * @property {number} format
 * @property {string} id
 * @property {string} name
 * @property {number} revision counts the times that it was stored
 * @property {number} saved when, ms since 1970
 * @property {Variant[]} variants
 * @property {number} active slot
 * @property {Variant[]} removed the last ones, so that they can be put back
 * @property {Imported[]} imported
 */

/**
 * What a variant's motion was made from and what came of it: everything that is shown of a variant.
 * @typedef {object} Result
 * @property {number} slot
 * @property {number} number of the request
 * @property {string} text what was asked, so that one sees whether it is what is edited now
 * @property {number | null} released when the edit's gesture ended; null: it goes on
 * @property {import("./motion.js").Motion | null} motion
 * @property {any} verdict the server's last word
 * @property {string} error why there is no motion
 * @property {any} ground
 * @property {boolean} due another request waits for its first frames
 */

export {};
