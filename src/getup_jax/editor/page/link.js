// The WebSocket to the server: requests with a number each, answers, and connecting again.

const RETRY_MS = 1000;

export class Link extends EventTarget {
  constructor() {
    super();
    this.number = 0;
    /** @type {Map<number, { resolve: (answer: any) => void, reject: (error: Error) => void }>} */
    this.waiting = new Map();
    /** @type {WebSocket} */
    this.socket;
    this.connect();
  }

  connect() {
    const address = new URL("socket", location.href);
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    address.search = location.search;
    address.hash = "";
    this.socket = new WebSocket(address);
    this.socket.binaryType = "arraybuffer";
    this.socket.onmessage = (event) => this.receive(event.data);
    this.socket.onclose = (event) => this.lost(event);
  }

  /** @param {CloseEvent} event */
  lost(event) {
    for (const { reject } of this.waiting.values()) reject(new Error("the connection was lost"));
    this.waiting.clear();
    this.tell("lost", { reason: event.reason });
    setTimeout(() => this.connect(), RETRY_MS);
  }

  get open() { return this.socket.readyState === WebSocket.OPEN; }

  /** Sends a request that frames answer; returns its number. @param {object} request */
  send(request) {
    this.number += 1;
    if (this.open) this.socket.send(JSON.stringify({ ...request, number: this.number }));
    return this.number;
  }

  /** Sends a request with one answer, and a file with it where there is one. @param {object} request @param {ArrayBuffer | null} file @returns {Promise<any>} */
  ask(request, file = null) {
    if (!this.open) return Promise.reject(new Error("not connected"));
    this.number += 1;
    const header = JSON.stringify({ ...request, number: this.number });
    this.socket.send(file === null ? header : packed(header, file));
    return new Promise((resolve, reject) => this.waiting.set(this.number, { resolve, reject }));
  }

  /** @param {string | ArrayBuffer} data */
  receive(data) {
    const message = typeof data === "string" ? JSON.parse(data) : unpacked(data);
    const waits = this.waiting.get(message.number);
    if (waits && message.type !== "progress") {
      this.waiting.delete(message.number);
      if (message.type === "error") waits.reject(new Error(message.text));
      else waits.resolve(message);
      return;
    }
    this.tell(message.type, message);
  }

  /** @param {string} type @param {object} detail */
  tell(type, detail) { this.dispatchEvent(new CustomEvent(type, { detail })); }
}

/** @param {string} header @param {ArrayBuffer} file */
function packed(header, file) {
  const text = new TextEncoder().encode(header);
  const whole = new Uint8Array(4 + text.length + file.byteLength);
  new DataView(whole.buffer).setUint32(0, text.length, true);
  whole.set(text, 4);
  whole.set(new Uint8Array(file), 4 + text.length);
  return whole;
}

/** @param {ArrayBuffer} data */
function unpacked(data) {
  const length = new DataView(data).getUint32(0, true);
  const text = new TextDecoder().decode(new Uint8Array(data, 4, length));
  return { ...JSON.parse(text), payload: data.slice(4 + length) };
}
