// What the browser draws 3-D pictures with, and when it has drawn one.

const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i;

// Whether the processor draws: then every pixel and triangle costs time that the simulation wants too.
export function drawsInSoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl && info ? String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return SOFTWARE.test(name);
}

// Follows one picture at a time through the renderer, which works beside the page.
export class Fence {
  /** @param {any} gl */
  constructor(gl) {
    this.gl = gl;
    /** @type {any} */
    this.sync = null;
    this.took = 0;
    this.free = 0;
    this.began = 0;
    /** @type {(() => void)[]} */
    this.after = [];
  }

  get waiting() { return this.sync !== null; }

  // The picture whose commands were just given.
  set() {
    const { gl } = this;
    this.began = performance.now();
    this.sync = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    if (this.sync === null) this.done(); // the context is lost
    else setTimeout(() => this.look(), 1);
  }

  /** Calls once the picture at hand is drawn. @param {() => void} call */
  then(call) {
    if (this.waiting) this.after.push(call);
    else call();
  }

  look() {
    const { gl, sync } = this;
    if (!gl.isContextLost() && gl.getSyncParameter(sync, gl.SYNC_STATUS) !== gl.SIGNALED) {
      setTimeout(() => this.look(), 1);
      return;
    }
    gl.deleteSync(sync);
    this.done();
  }

  done() {
    this.sync = null;
    this.free = performance.now();
    this.took = this.free - this.began;
    for (const call of this.after.splice(0)) call();
  }
}
