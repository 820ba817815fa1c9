/** The surface to scale: two canvases, one that stands still and one drawn with every moment. */

import { FINGER, PALM } from "./messages.js";
import { Trails } from "./trails.js";
import { colours, onColours, reducedMotion, textScale, TOUCH_COLOURS } from "./theme.js";

const FULL_TURN = 2 * Math.PI;

/** Room around the surface for cameras, their names and the rulers, at the usual text size. */
const MARGIN_PX = 44;
const NARROW_MARGIN_PX = 30;
const NARROW_PX = 480;

/** A stroke of a finger that lies flat; one that leans less has a shorter one. */
const FLAT_LEAN_MM = 45;
const SMALLEST_LEAN_DEG = 3;

const SMALLEST_RADIUS_PX = 5;
const TICKS_MM = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
const SMALLEST_TICK_PX = 46;

export class Surface {
  constructor(place, still, moving, shows) {
    this.place = place;
    this.still = still;
    this.moving = moving;
    this.shows = shows;
    this.trails = new Trails(TOUCH_COLOURS);
    this.hello = null;
    this.scale = 1;
    this.leftPx = this.topPx = 0;
    this.ratio = 1;
    this.unit = 1;
    this.small = this.bold = "";
    this.frames = 0;
    this.labels = new Map();
    new ResizeObserver(() => this.resize()).observe(place);
    onColours(() => this.drawStill());
  }

  setHello(hello) {
    this.hello = hello;
    const [width, height] = hello.surface_mm;
    this.place.style.setProperty("--shape", `${width} / ${height}`);
    this.reset();
    this.resize();
  }

  reset() {
    this.trails.clear();
    this.labels.clear();
  }

  resize() {
    if (this.hello === null) return;
    const { clientWidth, clientHeight } = this.place;
    this.ratio = window.devicePixelRatio || 1;
    for (const canvas of [this.still, this.moving]) {
      canvas.width = Math.round(clientWidth * this.ratio);
      canvas.height = Math.round(clientHeight * this.ratio);
    }
    this.unit = textScale();
    this.small = `${12 * this.unit}px system-ui, sans-serif`;
    this.bold = `600 ${13 * this.unit}px system-ui, sans-serif`;
    const margin = this.unit * (clientWidth < NARROW_PX ? NARROW_MARGIN_PX : MARGIN_PX);
    const [width, height] = this.hello.surface_mm;
    this.scale = Math.max(
      0.01,
      Math.min((clientWidth - 2 * margin) / width, (clientHeight - 2 * margin) / height),
    );
    this.leftPx = (clientWidth - width * this.scale) / 2;
    this.topPx = (clientHeight - height * this.scale) / 2;
    this.drawStill();
  }

  begin(canvas) {
    const context = canvas.getContext("2d");
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    context.clearRect(0, 0, canvas.width / this.ratio, canvas.height / this.ratio);
    return context;
  }

  x(xMm) {
    return this.leftPx + xMm * this.scale;
  }

  y(yMm) {
    return this.topPx + yMm * this.scale;
  }

  drawStill() {
    if (this.hello === null) return;
    const context = this.begin(this.still);
    const [width, height] = this.hello.surface_mm;
    context.fillStyle = colours.surface;
    context.fillRect(this.leftPx, this.topPx, width * this.scale, height * this.scale);
    this.drawRulers(context, width, height);
    this.drawDisplay(context);
    context.strokeStyle = colours["line-strong"];
    context.lineWidth = 2 * this.unit;
    context.strokeRect(this.leftPx, this.topPx, width * this.scale, height * this.scale);
    this.hello.cameras.forEach((camera, index) => this.drawCamera(context, camera, index));
  }

  drawRulers(context, width, height) {
    const tick = TICKS_MM.find((mm) => mm * this.scale >= SMALLEST_TICK_PX * this.unit) ?? TICKS_MM.at(-1);
    const bottom = this.y(height);
    const right = this.x(width);
    context.lineWidth = this.unit;
    context.strokeStyle = colours.line;
    context.fillStyle = colours.muted;
    context.font = this.small;
    context.beginPath();
    for (let mm = tick; mm < width; mm += tick) {
      context.moveTo(this.x(mm), this.topPx);
      context.lineTo(this.x(mm), bottom);
    }
    for (let mm = tick; mm < height; mm += tick) {
      context.moveTo(this.leftPx, this.y(mm));
      context.lineTo(right, this.y(mm));
    }
    context.stroke();
    context.textAlign = "center";
    context.textBaseline = "top";
    for (let mm = tick; mm < width - tick / 2; mm += tick) {
      context.fillText(String(mm), this.x(mm), bottom + 7 * this.unit);
    }
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (let mm = tick; mm < height - tick / 2; mm += tick) {
      context.fillText(String(mm), this.leftPx - 7 * this.unit, this.y(mm));
    }
  }

  drawDisplay(context) {
    const display = this.hello.display;
    if (!display) return;
    context.save();
    context.strokeStyle = colours.muted;
    context.setLineDash([6, 5]);
    context.lineWidth = this.unit;
    context.strokeRect(
      this.x(display.left_mm),
      this.y(display.top_mm),
      display.width_mm * this.scale,
      display.height_mm * this.scale,
    );
    context.restore();
    context.fillStyle = colours.muted;
    context.textAlign = "left";
    context.textBaseline = "top";
    context.fillText("display", this.x(display.left_mm) + 6, this.y(display.top_mm) + 5);
  }

  drawCamera(context, camera, index) {
    const [width, height] = this.hello.surface_mm;
    const x = this.x(camera.x_mm);
    const y = this.y(camera.y_mm);
    const left = camera.x_mm < width / 2;
    const top = camera.y_mm < height / 2;
    const outX = left ? -this.unit : this.unit;
    const outY = top ? -this.unit : this.unit;
    context.fillStyle = colours.cameras[index % colours.cameras.length];
    context.beginPath();
    context.arc(x, y, 6 * this.unit, 0, FULL_TURN);
    context.fill();
    context.font = this.bold;
    context.textAlign = left ? "right" : "left";
    context.textBaseline = top ? "bottom" : "top";
    context.fillText(camera.id, x + 8 * outX, y + 6 * outY);
  }

  /** Draw a moment; nothing is made anew here, so that no pause collects it. */
  draw(moment) {
    if (this.hello === null) return;
    const context = this.begin(this.moving);
    this.frames++;
    if (this.shows.lines) this.drawLines(context, moment);
    if (this.shows.trails && !Number.isNaN(moment.capturedAtS)) {
      const { scale, leftPx, topPx } = this;
      this.trails.draw(context, moment.capturedAtS, scale, leftPx, topPx, colours.touches);
    }
    if (this.shows.contacts) this.drawContacts(context, moment);
    this.drawTouches(context, moment);
  }

  drawLines(context, moment) {
    const [width, height] = this.hello.surface_mm;
    const far = 2 * Math.hypot(width, height) * this.scale;
    context.save();
    context.beginPath();
    context.rect(this.leftPx, this.topPx, width * this.scale, height * this.scale);
    context.clip();
    context.lineWidth = this.unit;
    // one triangle after the other: without a GPU one path of all takes three times as long
    const outlined = moment.shadows <= MOST_OUTLINED;
    for (let i = 0; i < moment.shadows; i++) {
      const number = moment.shadowCamera[i];
      if (number >= this.hello.cameras.length || !this.shows.cameras[number]) continue;
      const camera = this.hello.cameras[number];
      const x = this.x(camera.x_mm);
      const y = this.y(camera.y_mm);
      const first = moment.shadowFirstRad[i];
      const last = moment.shadowLastRad[i];
      context.fillStyle = context.strokeStyle = colours.cameras[number % colours.cameras.length];
      context.beginPath();
      context.moveTo(x + far * Math.cos(first), y + far * Math.sin(first));
      context.lineTo(x, y);
      context.lineTo(x + far * Math.cos(last), y + far * Math.sin(last));
      context.globalAlpha = 0.1;
      context.fill();
      if (!outlined) continue;
      context.globalAlpha = 0.3;
      context.stroke();
    }
    context.restore();
  }

  drawContacts(context, moment) {
    for (let i = 0; i < moment.contacts; i++) {
      const x = this.x(moment.contactXMm[i]);
      const y = this.y(moment.contactYMm[i]);
      const radius = this.radiusPx(moment.contactDiameterMm[i]) + 4 * this.unit;
      if (moment.contactRefused[i]) this.drawGhost(context, x, y, radius);
      else this.drawContact(context, moment, i, x, y, radius);
    }
  }

  drawGhost(context, x, y, radius) {
    const arm = radius * 0.6;
    context.strokeStyle = colours.bad;
    context.globalAlpha = 0.8;
    context.lineWidth = 1.5 * this.unit;
    context.setLineDash(DOTTED);
    context.beginPath();
    context.arc(x, y, radius, 0, FULL_TURN);
    context.stroke();
    context.setLineDash(SOLID);
    context.beginPath();
    context.moveTo(x - arm, y - arm);
    context.lineTo(x + arm, y + arm);
    context.moveTo(x + arm, y - arm);
    context.lineTo(x - arm, y + arm);
    context.stroke();
    context.globalAlpha = 1;
  }

  drawContact(context, moment, i, x, y, radius) {
    const touching = moment.contactTouching[i];
    const kind = moment.contactKind[i];
    context.strokeStyle = colours.muted;
    context.lineWidth = this.unit;
    context.setLineDash(touching ? SOLID : DASHED);
    context.beginPath();
    context.arc(x, y, radius, 0, FULL_TURN);
    context.stroke();
    context.setLineDash(SOLID);
    // the part of the ring that is bright is the confidence
    context.strokeStyle = kind === PALM ? colours.warn : colours.text;
    context.lineWidth = 2.5 * this.unit;
    context.beginPath();
    context.arc(x, y, radius, -FULL_TURN / 4, FULL_TURN * (moment.contactConfidence[i] - 0.25));
    context.stroke();
    if (kind !== FINGER || !touching) {
      context.fillStyle = kind === PALM ? colours.warn : colours.muted;
      context.font = this.small;
      context.textAlign = "center";
      context.textBaseline = "top";
      context.fillText(KIND_WORDS[kind], x, y + radius + 4 * this.unit);
    }
    this.drawLean(context, moment, i, x, y, radius);
  }

  drawLean(context, moment, i, x, y, radius) {
    const leanDeg = moment.contactLeanDeg[i];
    const azimuthDeg = moment.contactAzimuthDeg[i];
    if (!(leanDeg > SMALLEST_LEAN_DEG) || Number.isNaN(azimuthDeg)) return;
    const length = FLAT_LEAN_MM * Math.sin((leanDeg * Math.PI) / 180) * this.scale;
    const azimuth = (azimuthDeg * Math.PI) / 180;
    context.strokeStyle = colours.accent;
    context.lineWidth = 2.5 * this.unit;
    context.beginPath();
    context.moveTo(x + radius * Math.cos(azimuth), y + radius * Math.sin(azimuth));
    context.lineTo(
      x + (radius + length) * Math.cos(azimuth),
      y + (radius + length) * Math.sin(azimuth),
    );
    context.stroke();
  }

  drawTouches(context, moment) {
    context.font = this.bold;
    context.textAlign = "left";
    context.textBaseline = "bottom";
    for (let i = 0; i < moment.touches; i++) {
      const x = this.x(moment.touchXMm[i]);
      const y = this.y(moment.touchYMm[i]);
      const radius = this.radiusPx(moment.touchDiameterMm[i]);
      const id = moment.touchId[i];
      context.fillStyle = colours.touches[Math.abs(id) % TOUCH_COLOURS];
      context.beginPath();
      context.arc(x, y, radius, 0, FULL_TURN);
      context.fill();
      if (this.shows.names) {
        context.fillStyle = colours.text;
        context.fillText(this.label(id), x + radius + 5 * this.unit, y - radius - this.unit);
      }
    }
  }

  label(id) {
    let label = this.labels.get(id);
    if (label === undefined) {
      if (this.labels.size > MOST_LABELS) this.labels.clear();
      label = String(id);
      this.labels.set(id, label);
    }
    return label;
  }

  radiusPx(diameterMm) {
    return Math.max(SMALLEST_RADIUS_PX * this.unit, (diameterMm / 2) * this.scale || 0);
  }
}

const KIND_WORDS = ["hovers", "palm", "pen"];
const SOLID = [];
const DASHED = [5, 4];
const DOTTED = [2, 3];
const MOST_LABELS = 1000;

/** With more shadows outlines cover each other, and cost most of the time. */
const MOST_OUTLINED = 80;

/** What is shown at first; trails move, so not for those who want no motion. */
export function usualShows() {
  return {
    lines: true,
    trails: !reducedMotion.matches,
    contacts: true,
    names: true,
    cameras: [true, true, true, true],
  };
}
