// The motion of one variant as it arrives: link poses, achieved features, the end of the episode.

const DEGREES = 180 / Math.PI;

export class Motion {
  /** @param {number} number of the request @param {number} total frames @param {number} links @param {import("./types.js").Ground | null} ground null: flat */
  constructor(number, total, links, ground) {
    this.number = number;
    this.total = total;
    this.links = links;
    this.count = 0; // frames that are there
    this.ended = Infinity; // first frame after the episode's end
    this.poses = new Float32Array(total * links * 7);
    this.features = [new Float32Array(total), new Float32Array(total), new Float32Array(total)];
    this.result = null;
    this.ground = ground;
  }

  /** Frames that have come. @param {{ first: number, count: number, payload: ArrayBuffer }} message */
  add(message) {
    const values = new Float32Array(message.payload);
    const width = this.links * 7 + 4;
    for (let i = 0; i < message.count; i++) {
      const frame = message.first + i;
      const row = values.subarray(i * width, (i + 1) * width);
      this.poses.set(row.subarray(0, this.links * 7), frame * this.links * 7);
      this.features[0][frame] = row[this.links * 7];
      this.features[1][frame] = row[this.links * 7 + 1] * DEGREES;
      this.features[2][frame] = row[this.links * 7 + 2] * DEGREES;
      if (!row[width - 1]) this.ended = Math.min(this.ended, frame);
    }
    this.count = message.first + message.count;
  }

  /** Seven numbers a link: position and quaternion (wxyz). @param {number} frame */
  pose(frame) {
    const size = this.links * 7;
    return this.poses.subarray(frame * size, (frame + 1) * size);
  }
}
