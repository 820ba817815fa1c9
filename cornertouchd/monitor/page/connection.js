/** The way to the server: asks who it is, listens, and begins anew when it is gone. */

const FIRST_WAIT_S = 0.5;
const LONGEST_WAIT_S = 8;
const ANSWER_WITHIN_MS = 5000;

/** The server will not answer this page, whenever it asks: it was called by a strange name. */
const REFUSALS = new Set([403, 421]);

/** A tab that nobody sees lets go of its place among the viewers after this time. */
const HIDDEN_FOR_MS = 15000;

/**
 * Keeps one WebSocket alive.
 *
 * `onState(state, waitS, why)` tells "connecting", "live", "gone", "full", "token", "refused" or
 * "paused"; `onBinary(view)` and `onText(object)` take the messages; `onHello(hello)` comes before
 * them.
 */
export class Connection {
  constructor(listener) {
    this.listener = listener;
    this.socket = null;
    this.timer = 0;
    this.waitS = FIRST_WAIT_S;
    this.wants = { strips: false };
    this.attempt = 0;
    this.hiddenTimer = 0;
    document.addEventListener("visibilitychange", () => this.followVisibility());
    window.addEventListener("online", () => this.connect());
  }

  /** Begin, now, whatever was waited for. */
  async connect() {
    clearTimeout(this.timer);
    this.drop();
    const attempt = ++this.attempt;
    this.listener.onState("connecting", 0);
    let answer;
    try {
      answer = await fetch("/api/hello", {
        cache: "no-store",
        signal: AbortSignal.timeout(ANSWER_WITHIN_MS),
      });
    } catch {
      if (attempt === this.attempt) this.retry("gone");
      return;
    }
    if (attempt !== this.attempt) return;
    if (answer.status === 401) {
      this.listener.onState("token", 0);
      return;
    }
    const said = await answer.json().catch(() => ({}));
    if (attempt !== this.attempt) return;
    if (answer.ok && Array.isArray(said.cameras)) {
      this.listener.onHello(said);
      this.listen();
    } else if (REFUSALS.has(answer.status)) {
      this.listener.onState("refused", 0, said.error);
    } else {
      this.retry("gone");
    }
  }

  /** The server is there, the daemon behind it is not: its end of the line is of no use. */
  lose() {
    this.drop();
    this.retry("gone");
  }

  /** Offer a token; resolves to whether it was accepted, and connects then. */
  async offerToken(token) {
    const answer = await fetch(`/?token=${encodeURIComponent(token)}`, { cache: "no-store" });
    if (!answer.ok) return false;
    const asked = await fetch("/api/hello", { cache: "no-store" });
    if (asked.status === 401) return false;
    this.waitS = FIRST_WAIT_S;
    this.connect();
    return true;
  }

  /** Ask for strips, or no longer. */
  wantStrips(strips) {
    if (strips === this.wants.strips) return;
    this.wants.strips = strips;
    this.tellWants();
  }

  tellWants() {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(this.wants));
  }

  listen() {
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(`${scheme}//${location.host}/live`);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    let opened = false;
    socket.onopen = () => {
      opened = true;
      this.waitS = FIRST_WAIT_S;
      this.tellWants();
      this.listener.onState("live", 0);
    };
    socket.onmessage = (event) => {
      if (typeof event.data === "string") this.listener.onText(JSON.parse(event.data));
      else this.listener.onBinary(new DataView(event.data));
    };
    socket.onclose = (event) => {
      if (socket !== this.socket) return;
      this.socket = null;
      // the server greets every page, but has places for so many viewers only
      this.retry(opened && event.code !== 1013 ? "gone" : "full");
    };
  }

  retry(state) {
    const waitS = this.waitS * (0.8 + 0.4 * Math.random());
    this.waitS = Math.min(2 * this.waitS, LONGEST_WAIT_S);
    this.listener.onState(state, waitS);
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.connect(), 1000 * waitS);
  }

  drop() {
    const socket = this.socket;
    this.socket = null;
    socket?.close();
  }

  followVisibility() {
    clearTimeout(this.hiddenTimer);
    if (document.hidden) {
      this.hiddenTimer = setTimeout(() => {
        clearTimeout(this.timer);
        this.attempt++;
        this.drop();
        this.listener.onState("paused", 0);
      }, HIDDEN_FOR_MS);
    } else if (this.socket === null) {
      this.connect();
    }
  }
}
