/** "Save what just happened": the pictures that the daemon keeps, as a recording. */

import { byId, say } from "./elements.js";
import { megabytes } from "./words.js";

const USUAL_S = 30;

export class Saving {
  constructor() {
    this.button = byId("save");
    this.result = byId("save-result");
    this.lastS = USUAL_S;
    this.button.addEventListener("click", () => this.save());
  }

  setHello(hello) {
    this.lastS = hello.keeps_s ?? USUAL_S;
    this.button.hidden = !(hello.may_act && this.lastS > 0);
    say(this.button, `Save the last ${Math.round(this.lastS)} s`);
  }

  async save() {
    this.button.disabled = true;
    this.show("saving", "Saving …");
    try {
      const answer = await fetch("/api/save", {
        method: "POST",
        headers: { "Content-Type": "application/json" },
        body: JSON.stringify({ last_s: this.lastS }),
      });
      const said = await answer.json().catch(() => ({}));
      if (answer.ok) {
        const size = typeof said.bytes === "number" ? `, ${megabytes(said.bytes)}` : "";
        this.show("saved", `Saved: ${said.path ?? said.name}${size}`);
      } else {
        this.show("refused", `Not saved: ${said.error ?? `the server answered ${answer.status}`}`);
      }
    } catch (error) {
      this.show("refused", `Not saved: ${error.message}`);
    }
    this.button.disabled = false;
  }

  show(kind, text) {
    this.result.className = `notice ${kind}`;
    this.result.hidden = false;
    say(byId("save-text"), text);
  }
}
