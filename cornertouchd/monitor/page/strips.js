/** What each camera sees: its picture stretched in height, and the profile that is made of it. */

import { PROFILE_ONE } from "./messages.js";
import { colours, onColours, textScale } from "./theme.js";

const PICTURE_PX = 56;
const GAP_PX = 6;
const PROFILE_PX = 92;
const FULL_PROFILE = 250;
const FULL_SCALE = 255;

const STRIP_HEIGHT_PX = PICTURE_PX + GAP_PX + PROFILE_PX;

const percent = (share) => `${Math.round(100 * share)} %`;

/** One camera's panel, a copy of the template. */
class StripPanel {
  constructor(template, camera, index) {
    this.root = template.content.firstElementChild.cloneNode(true);
    this.camera = camera;
    this.strip = null;
    this.dirty = false;
    this.find("name").textContent = camera.id;
    this.root.dataset.camera = String(index + 1);
    this.root.setAttribute("aria-label", `Camera ${camera.id}`);
    this.canvas = this.root.querySelector("canvas");
    this.picture = document.createElement("canvas");
    this.pixels = null;
    new ResizeObserver(() => this.redraw()).observe(this.canvas);
  }

  find(part) {
    return this.root.querySelector(`[data-part="${part}"]`);
  }

  redraw() {
    this.dirty = true;
    requestAnimationFrame(() => this.draw());
  }

  take(strip) {
    this.strip = strip;
    this.redraw();
  }

  /** Tell what the daemon counts of this camera. */
  tell(health) {
    const lost = health === undefined || !health.live;
    this.root.classList.toggle("lost", lost);
    const rate = lost ? "lost" : `${health.pictures_per_s.toFixed(0)}/s`;
    this.find("rate").textContent = rate;
    if (lost) this.clear();
  }

  clear() {
    this.strip = null;
    this.redraw();
  }

  draw() {
    if (!this.dirty) return;
    this.dirty = false;
    // as high as text makes it; everything is drawn as if text had its smallest size
    const unit = textScale();
    const ratio = unit * (window.devicePixelRatio || 1);
    const width = this.canvas.clientWidth / unit;
    this.canvas.style.height = `${STRIP_HEIGHT_PX * unit}px`;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(STRIP_HEIGHT_PX * ratio);
    const context = this.canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = colours.surface;
    context.fillRect(0, 0, width, PICTURE_PX);
    context.fillRect(0, PICTURE_PX + GAP_PX, width, PROFILE_PX);
    if (this.strip === null) {
      context.fillStyle = colours.muted;
      context.font = "12px system-ui, sans-serif";
      context.textAlign = "center";
      context.textBaseline = "middle";
      context.fillText("no picture", width / 2, STRIP_HEIGHT_PX / 2);
      this.describe(null);
      return;
    }
    this.drawPicture(context, width);
    this.drawCurves(context, width);
    this.drawMasked(context, width);
    this.drawEdges(context, width);
    this.describe(this.strip);
  }

  drawPicture(context, width) {
    const { widthPx, rowsPx, picture } = this.strip;
    if (widthPx === 0 || rowsPx === 0) return;
    if (this.pixels?.width !== widthPx || this.pixels.height !== rowsPx) {
      this.picture.width = widthPx;
      this.picture.height = rowsPx;
      this.pixels = new ImageData(widthPx, rowsPx);
    }
    const to = this.pixels.data;
    for (let i = 0, at = 0; i < picture.length; i++, at += 4) {
      to[at] = to[at + 1] = to[at + 2] = picture[i];
      to[at + 3] = 255;
    }
    this.picture.getContext("2d").putImageData(this.pixels, 0, 0);
    context.imageSmoothingEnabled = false;
    context.drawImage(this.picture, 0, 0, width, PICTURE_PX);
  }

  drawMasked(context, width) {
    const { widthPx, state } = this.strip;
    context.fillStyle = colours.masked;
    for (let from = 0; from < widthPx; from++) {
      if (!(state[from] & 1)) continue;
      let to = from;
      while (to < widthPx && state[to] & 1) to++;
      const x = (from / widthPx) * width;
      context.fillRect(x, 0, Math.max(1, ((to - from) / widthPx) * width), STRIP_HEIGHT_PX);
      from = to;
    }
  }

  drawCurves(context, width) {
    const { widthPx, profile, reference, darkLevel } = this.strip;
    const bottom = STRIP_HEIGHT_PX;
    const grey = PROFILE_PX / FULL_SCALE;
    context.fillStyle = colours.reference;
    context.beginPath();
    context.moveTo(0, bottom);
    for (let u = 0; u < widthPx; u++) {
      context.lineTo(((u + 0.5) / widthPx) * width, bottom - reference[u] * grey);
    }
    context.lineTo(width, bottom);
    context.fill();
    context.lineWidth = 1;
    context.strokeStyle = colours.line;
    const one = bottom - (PROFILE_ONE / FULL_PROFILE) * PROFILE_PX;
    context.beginPath();
    context.moveTo(0, one);
    context.lineTo(width, one);
    context.stroke();
    if (!Number.isNaN(darkLevel)) {
      context.setLineDash(DASHED);
      context.strokeStyle = colours.muted;
      context.beginPath();
      context.moveTo(0, bottom - darkLevel * grey - 0.5);
      context.lineTo(width, bottom - darkLevel * grey - 0.5);
      context.stroke();
      context.setLineDash(SOLID);
    }
    context.strokeStyle = colours.profile;
    context.lineWidth = 1.5;
    context.lineJoin = "round";
    context.beginPath();
    for (let u = 0; u < widthPx; u++) {
      const y = bottom - (profile[u] / FULL_PROFILE) * (PROFILE_PX - 2) - 1;
      context.lineTo(((u + 0.5) / widthPx) * width, y);
    }
    context.stroke();
  }

  drawEdges(context, width) {
    const { widthPx, edgesPx } = this.strip;
    context.strokeStyle = colours.edge;
    context.lineWidth = 1;
    context.beginPath();
    for (const edge of edgesPx) {
      const x = (edge / widthPx) * width;
      context.moveTo(x, 0);
      context.lineTo(x, STRIP_HEIGHT_PX);
    }
    context.stroke();
  }

  describe(strip) {
    if (strip === null) {
      this.canvas.setAttribute("aria-label", `${this.camera.id}: no picture`);
      for (const name of ["level", "contrast"]) this.bar(name, 0, "");
      for (const name of ["edges", "masked", "dark"]) this.find(name).textContent = "–";
      return;
    }
    let masked = 0;
    for (const state of strip.state) masked += state & 1;
    const share = strip.widthPx ? masked / strip.widthPx : 0;
    const dark = Number.isNaN(strip.darkLevel) ? "none" : strip.darkLevel.toFixed(1);
    this.bar("level", strip.level / FULL_SCALE, percent(strip.level / FULL_SCALE));
    this.bar("contrast", strip.contrast, percent(strip.contrast));
    this.find("edges").textContent = String(strip.edgesPx.length);
    this.find("masked").textContent = percent(share);
    this.find("dark").textContent = dark;
    this.canvas.setAttribute(
      "aria-label",
      `${this.camera.id}: exposure ${percent(strip.level / FULL_SCALE)}, contrast ` +
        `${percent(strip.contrast)}, ${strip.edgesPx.length} edges, ${percent(share)} masked`,
    );
  }

  bar(name, share, text) {
    const bar = this.find(name);
    bar.value = Math.min(Math.max(share, 0), 1);
    bar.textContent = text;
    this.find(`${name}-text`).textContent = text || "–";
  }
}

const SOLID = [];
const DASHED = [4, 4];

export class Strips {
  constructor(place, template) {
    this.place = place;
    this.template = template;
    this.panels = [];
    this.drawn = 0;
    onColours(() => this.panels.forEach((panel) => panel.redraw()));
  }

  setHello(hello) {
    this.panels = hello.cameras.map((one, index) => new StripPanel(this.template, one, index));
    this.place.replaceChildren(...this.panels.map((panel) => panel.root));
    this.panels.forEach((panel) => panel.redraw());
  }

  take(strip) {
    this.drawn++;
    this.panels[strip.camera]?.take(strip);
  }

  tell(health) {
    const byId = new Map(health.cameras.map((camera) => [camera.id, camera]));
    for (const panel of this.panels) panel.tell(byId.get(panel.camera.id));
  }

  clear() {
    for (const panel of this.panels) panel.clear();
  }
}
