/** The touches as a table, for those who want numbers, or cannot see the surface. */

import { byId, fillRows } from "./elements.js";

const EVERY_MS = 400;
const TOLD_EVERY_MS = 3000;

export class TouchTable {
  constructor(moment, canvas) {
    this.moment = moment;
    this.canvas = canvas;
    this.details = byId("touch-table");
    this.told = "";
    setInterval(() => this.draw(), EVERY_MS);
    setInterval(() => this.describe(), TOLD_EVERY_MS);
  }

  draw() {
    if (!this.details.open || document.hidden) return;
    const { moment } = this;
    const rows = [];
    for (let i = 0; i < moment.touches; i++) {
      rows.push([
        String(moment.touchId[i]),
        moment.touchXMm[i].toFixed(1),
        moment.touchYMm[i].toFixed(1),
        Math.hypot(moment.touchVxMmS[i], moment.touchVyMmS[i]).toFixed(0),
        Number.isNaN(moment.touchDiameterMm[i]) ? "–" : moment.touchDiameterMm[i].toFixed(1),
        moment.touchAgeS[i].toFixed(1),
      ]);
    }
    fillRows(byId("touches-body"), rows);
  }

  describe() {
    const count = this.moment.touches;
    const text = `The surface with ${count === 1 ? "1 touch" : `${count} touches`}`;
    if (text !== this.told) this.canvas.setAttribute("aria-label", text);
    this.told = text;
  }
}
