/** What is shown on the surface: switches, keys, kept from one visit to the next. */

import { byId, make } from "./elements.js";
import { keep, kept } from "./keeping.js";

const KEYS = { l: "lines", t: "trails", c: "contacts", n: "names" };
const FIELDS = "input:not([type=checkbox]), select, textarea, [contenteditable]";

export class Switches {
  /** `shows` is what they set; `changed` is called after that. */
  constructor(shows, changed) {
    this.shows = shows;
    this.changed = changed;
    this.cameras = [];
    Object.assign(shows, kept("shows", {}));
    for (const name of Object.values(KEYS)) {
      const box = byId(`show-${name}`);
      box.checked = shows[name];
      box.addEventListener("change", () => this.set(name, box.checked));
    }
    this.keys = byId("use-keys");
    this.keys.checked = kept("keys", true);
    this.keys.addEventListener("change", () => keep("keys", this.keys.checked));
    document.addEventListener("keydown", (event) => this.press(event));
  }

  setHello(hello) {
    this.cameras = hello.cameras.map((camera, index) => {
      const box = make("input");
      box.type = "checkbox";
      box.checked = this.shows.cameras[index] ?? true;
      box.addEventListener("change", () => {
        this.shows.cameras[index] = box.checked;
        this.kept();
      });
      const label = make("label", "chip", box, make("span", "", camera.id));
      label.dataset.camera = String(index + 1);
      label.title = `Directing lines of ${camera.id} (key ${index + 1})`;
      return { box, label };
    });
    byId("camera-switches").replaceChildren(...this.cameras.map((one) => one.label));
  }

  set(name, on) {
    this.shows[name] = on;
    this.kept();
  }

  kept() {
    keep("shows", this.shows);
    this.changed();
  }

  press(event) {
    if (!this.keys.checked || event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.target.closest?.(FIELDS) || document.querySelector("dialog[open]")) return;
    const key = event.key.toLowerCase();
    if (key in KEYS) byId(`show-${KEYS[key]}`).click();
    else if (this.cameras[Number(key) - 1]) this.cameras[Number(key) - 1].box.click();
    else if (key === "f") byId("fullscreen").click();
    else if (key === "d") byId("theme").click();
    else if (key === "?") byId("help").click();
    else return;
    event.preventDefault();
  }
}
