// A session of a headset: its frames, one after the other.

export class Immersion extends EventTarget {
  #session = null;
  #space = null;
  origin = 0; // counts recentres

  // Events: "start", "end", "hidden" (something of the headset lies over the session), "frame" {detail: {frame, space, layer, now}},
  // "moved" (the headset took its space anew: what was known of places is void).
  constructor(gl) {
    super();
    this.gl = gl;
  }

  // Whether this browser shows a headset: "" if it does, otherwise why not.
  static async missing() {
    if (!isSecureContext) return "Headsets only work over https or on localhost.";
    if (!navigator.xr) return "This browser knows no headset (WebXR).";
    return (await navigator.xr.isSessionSupported("immersive-vr").catch(() => false)) ? "" : "No headset is connected.";
  }

  get active() {
    return Boolean(this.#session);
  }

  async enter() {
    const session = await navigator.xr.requestSession("immersive-vr", { requiredFeatures: ["local-floor"], optionalFeatures: ["hand-tracking"] });
    await this.gl.makeXRCompatible();
    session.updateRenderState({ baseLayer: new XRWebGLLayer(session, this.gl), depthNear: 0.03, depthFar: 60 });
    this.#space = await session.requestReferenceSpace("local-floor");
    this.#space.addEventListener("reset", () => this.recentre());
    session.addEventListener("end", () => this.#ended());
    session.addEventListener("visibilitychange", () => session.visibilityState !== "visible" && this.#tell("hidden"));
    this.#session = session;
    this.recentre();
    this.#tell("start");
    const draw = (now, frame) => {
      if (session !== this.#session) return;
      session.requestAnimationFrame(draw);
      this.#tell("frame", { frame, now, space: this.#space, layer: session.renderState.baseLayer });
    };
    session.requestAnimationFrame(draw);
  }

  leave() {
    this.#session?.end();
  }

  // Ahead is where the head looks next.
  recentre() {
    this.origin = (this.origin + 1) % 256;
    this.#tell("moved");
  }

  #ended() {
    this.#session = null;
    this.#tell("end");
  }

  #tell(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}
