/** The last lines of the daemon's log. */

import { byId, make } from "./elements.js";
import { keep, kept } from "./keeping.js";

const RANK = { DEBUG: 0, INFO: 1, WARNING: 2, ERROR: 3, CRITICAL: 4 };

export class LogView {
  constructor() {
    this.lines = [];
    this.place = byId("log");
    this.level = byId("log-level");
    this.level.value = kept("log-level", "INFO");
    this.level.addEventListener("change", () => {
      keep("log-level", this.level.value);
      this.draw();
    });
  }

  tell(lines) {
    const last = this.lines.at(-1);
    const next = lines.at(-1);
    const same = this.lines.length === lines.length && last?.at === next?.at;
    this.lines = lines;
    if (!same || last?.text !== next?.text) this.draw();
  }

  /** Draw the lines; who reads further up is left there. */
  draw() {
    const { scrollTop, scrollHeight, clientHeight } = this.place;
    const atEnd = scrollHeight - scrollTop - clientHeight < 24;
    const shown = this.lines.filter((line) => (RANK[line.level] ?? 1) >= RANK[this.level.value]);
    this.place.replaceChildren(...shown.map((line) => this.row(line)));
    byId("log-none").hidden = shown.length > 0;
    if (atEnd) this.place.scrollTop = this.place.scrollHeight;
  }

  row(line) {
    const at = new Date(1000 * line.at);
    const time = make("time", "", at.toLocaleTimeString("en-GB"));
    time.dateTime = at.toISOString();
    time.title = at.toLocaleString();
    const level = make("b", "", line.level.toLowerCase());
    return make("li", line.level.toLowerCase(), time, level, make("span", "", line.text));
  }
}
