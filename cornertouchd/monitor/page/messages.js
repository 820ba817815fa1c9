/** What the server sends in binary: moments and strips, little-endian, read without copies. */

export const KIND_MOMENT = 1;
export const KIND_STRIP = 2;

export const FINGER = 0;
export const PALM = 1;
export const PEN = 2;

/** Counts are one byte each. */
const MOST = 255;
const MOST_SHADOWS = 1024;

const MOMENT_HEADER = 20;
const TOUCH_SIZE = 28;
const CONTACT_SIZE = 28;
const CAMERA_SIZE = 4;
const SHADOW_SIZE = 8;
const STRIP_HEADER = 32;

/** A profile of 1.25, brighter than the empty strip, is sent as 250. */
export const PROFILE_ONE = 200;

/** Everything of one instant; made once and filled again with each message. */
export class Moment {
  constructor() {
    this.capturedAtS = NaN;
    this.latencyMs = NaN;
    this.skewMs = NaN;

    this.touches = 0;
    this.touchId = new Int32Array(MOST);
    this.touchXMm = new Float32Array(MOST);
    this.touchYMm = new Float32Array(MOST);
    this.touchVxMmS = new Float32Array(MOST);
    this.touchVyMmS = new Float32Array(MOST);
    this.touchDiameterMm = new Float32Array(MOST);
    this.touchAgeS = new Float32Array(MOST);

    this.contacts = 0;
    this.contactXMm = new Float32Array(MOST);
    this.contactYMm = new Float32Array(MOST);
    this.contactDiameterMm = new Float32Array(MOST);
    this.contactConfidence = new Float32Array(MOST);
    this.contactLeanDeg = new Float32Array(MOST);
    this.contactAzimuthDeg = new Float32Array(MOST);
    this.contactTouching = new Uint8Array(MOST);
    this.contactKind = new Uint8Array(MOST);
    this.contactRefused = new Uint8Array(MOST);

    this.shadows = 0;
    this.shadowCamera = new Uint8Array(MOST_SHADOWS);
    this.shadowFirstRad = new Float32Array(MOST_SHADOWS);
    this.shadowLastRad = new Float32Array(MOST_SHADOWS);
  }

  /** Forget what was there, as when the connection is lost. */
  clear() {
    this.capturedAtS = this.latencyMs = this.skewMs = NaN;
    this.touches = this.contacts = this.shadows = 0;
  }

  /** Fill with a message of kind 1; throws RangeError if it is shorter than it says. */
  read(view) {
    const touches = view.getUint8(1);
    const contacts = view.getUint8(2);
    const cameras = view.getUint8(3);
    this.capturedAtS = view.getFloat64(4, true);
    this.latencyMs = view.getFloat32(12, true);
    this.skewMs = view.getFloat32(16, true);
    let at = MOMENT_HEADER;
    this.touches = 0;
    for (let i = 0; i < touches; i++, at += TOUCH_SIZE) {
      this.touchId[i] = view.getInt32(at, true);
      this.touchXMm[i] = view.getFloat32(at + 4, true);
      this.touchYMm[i] = view.getFloat32(at + 8, true);
      this.touchVxMmS[i] = view.getFloat32(at + 12, true);
      this.touchVyMmS[i] = view.getFloat32(at + 16, true);
      this.touchDiameterMm[i] = view.getFloat32(at + 20, true);
      this.touchAgeS[i] = view.getFloat32(at + 24, true);
      this.touches = i + 1;
    }
    this.contacts = 0;
    for (let i = 0; i < contacts; i++, at += CONTACT_SIZE) {
      this.contactXMm[i] = view.getFloat32(at, true);
      this.contactYMm[i] = view.getFloat32(at + 4, true);
      this.contactDiameterMm[i] = view.getFloat32(at + 8, true);
      this.contactConfidence[i] = view.getFloat32(at + 12, true);
      this.contactLeanDeg[i] = view.getFloat32(at + 16, true);
      this.contactAzimuthDeg[i] = view.getFloat32(at + 20, true);
      const flags = view.getUint8(at + 24);
      this.contactTouching[i] = flags & 1;
      this.contactKind[i] = (flags >> 1) & 3;
      this.contactRefused[i] = (flags >> 3) & 1;
      this.contacts = i + 1;
    }
    this.shadows = 0;
    for (let i = 0; i < cameras; i++) {
      const camera = view.getUint8(at);
      const count = view.getUint8(at + 1);
      at += CAMERA_SIZE;
      for (let k = 0; k < count; k++, at += SHADOW_SIZE) {
        const first = view.getFloat32(at, true);
        const last = view.getFloat32(at + 4, true);
        if (this.shadows === MOST_SHADOWS) continue;
        this.shadowCamera[this.shadows] = camera;
        this.shadowFirstRad[this.shadows] = first;
        this.shadowLastRad[this.shadows] = last;
        this.shadows++;
      }
    }
  }
}

/** Return a strip, a message of kind 2; throws RangeError if it is shorter than it says. */
export function readStrip(view) {
  const widthPx = view.getUint16(2, true);
  const rowsPx = view.getUint16(4, true);
  const edges = view.getUint16(6, true);
  const start = view.byteOffset + STRIP_HEADER;
  const picture = new Uint8Array(view.buffer, start, rowsPx * widthPx);
  const profile = new Uint8Array(view.buffer, start + rowsPx * widthPx, widthPx);
  const reference = new Uint8Array(view.buffer, start + (rowsPx + 1) * widthPx, widthPx);
  const state = new Uint8Array(view.buffer, start + (rowsPx + 2) * widthPx, widthPx);
  const edgesPx = new Float32Array(edges);
  const edgesAt = STRIP_HEADER + (rowsPx + 3) * widthPx;
  for (let i = 0; i < edges; i++) edgesPx[i] = view.getFloat32(edgesAt + 4 * i, true);
  return {
    camera: view.getUint8(1),
    widthPx,
    rowsPx,
    capturedAtS: view.getFloat64(8, true),
    level: view.getFloat32(16, true),
    contrast: view.getFloat32(20, true),
    darkLevel: view.getFloat32(24, true),
    picture,
    profile,
    reference,
    state,
    edgesPx,
  };
}
