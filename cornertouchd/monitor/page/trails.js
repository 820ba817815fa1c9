/** Where touches have been: one ring of places for each, all allocated once. */

const SLOTS = 256;
const POINTS = 96;

/** A trail is drawn in bands that fade with age: to fade every piece on its own costs frames. */
const BANDS = 4;
const FREE = -1;

export const TRAIL_S = 1.4;

export class Trails {
  constructor(colours) {
    this.colours = colours;
    this.id = new Int32Array(SLOTS).fill(FREE);
    this.count = new Uint16Array(SLOTS);
    this.newest = new Uint16Array(SLOTS);
    this.atS = new Float64Array(SLOTS * POINTS);
    this.xMm = new Float32Array(SLOTS * POINTS);
    this.yMm = new Float32Array(SLOTS * POINTS);
  }

  clear() {
    this.id.fill(FREE);
  }

  /** Take the touches of a moment; forget those that went long ago. */
  add(moment) {
    for (let slot = 0; slot < SLOTS; slot++) {
      if (this.id[slot] === FREE) continue;
      const goneS = moment.capturedAtS - this.atS[slot * POINTS + this.newest[slot]];
      if (goneS > TRAIL_S || goneS < 0) this.id[slot] = FREE;
    }
    for (let i = 0; i < moment.touches; i++) {
      const slot = this.slotOf(moment.touchId[i]);
      if (slot === FREE) continue;
      const newest = (this.newest[slot] + 1) % POINTS;
      const at = slot * POINTS + newest;
      this.newest[slot] = newest;
      if (this.count[slot] < POINTS) this.count[slot]++;
      this.atS[at] = moment.capturedAtS;
      this.xMm[at] = moment.touchXMm[i];
      this.yMm[at] = moment.touchYMm[i];
    }
  }

  /** Draw them in pixels of `scale` to the millimetre from (leftPx, topPx). */
  draw(context, nowS, scale, leftPx, topPx, palette) {
    context.lineCap = context.lineJoin = "round";
    for (let colour = 0; colour < this.colours; colour++) {
      context.strokeStyle = palette[colour];
      for (let band = 0; band < BANDS; band++) {
        const youngS = (band / BANDS) * TRAIL_S;
        context.globalAlpha = 0.75 * (1 - (band + 0.5) / BANDS);
        context.lineWidth = Math.max(1.5, scale * (3.2 - 0.7 * band));
        context.beginPath();
        for (let slot = 0; slot < SLOTS; slot++) {
          if (this.id[slot] === FREE || this.id[slot] % this.colours !== colour) continue;
          this.trace(context, slot, nowS - youngS, TRAIL_S / BANDS, scale, leftPx, topPx);
        }
        context.stroke();
      }
    }
    context.globalAlpha = 1;
  }

  /** Add the piece of one trail from `fromS` back over `spanS` to the path. */
  trace(context, slot, fromS, spanS, scale, leftPx, topPx) {
    let drawing = false;
    for (let back = 0; back < this.count[slot]; back++) {
      const at = slot * POINTS + ((this.newest[slot] - back + POINTS) % POINTS);
      const atS = this.atS[at];
      if (atS > fromS) continue;
      const x = leftPx + this.xMm[at] * scale;
      const y = topPx + this.yMm[at] * scale;
      if (drawing) context.lineTo(x, y);
      else context.moveTo(x, y);
      drawing = true;
      if (atS < fromS - spanS) return; // one place beyond, so that bands meet
    }
  }

  slotOf(id) {
    let free = FREE;
    for (let slot = 0; slot < SLOTS; slot++) {
      if (this.id[slot] === id) return slot;
      if (free === FREE && this.id[slot] === FREE) free = slot;
    }
    if (free !== FREE) {
      this.id[free] = id;
      this.count[free] = 0;
    }
    return free;
  }
}
