/** The live page: what comes in goes to those who show it. */

import { Connection } from "./connection.js";
import { byId, say } from "./elements.js";
import { HealthView } from "./health.js";
import { LogView } from "./log.js";
import { KIND_MOMENT, KIND_STRIP, Moment, readStrip } from "./messages.js";
import { Saving } from "./saving.js";
import { Strips } from "./strips.js";
import { Surface, usualShows } from "./surface.js";
import { Switches } from "./switches.js";
import { onColours, switchTheme } from "./theme.js";
import { TouchTable } from "./touch_table.js";

/** Without moments for so long the cameras see nothing: touches are gone, too. */
const SILENT_AFTER_MS = 1500;
const LOOK_EVERY_MS = 250;

const WORDS = {
  connecting: "connecting",
  live: "live",
  gone: "daemon gone",
  full: "no place left",
  token: "token needed",
  paused: "paused",
  refused: "refused",
};

const NOTICES = {
  connecting: ["Connecting", "Looking for the daemon."],
  gone: ["The daemon is gone", "It does not answer. This page goes on by itself as soon as it does."],
  full: ["No place left", "As many viewers as allowed are looking. This page tries again by itself."],
  paused: ["Paused", "Nobody was looking."],
  refused: ["Refused", ""],
};

const moment = new Moment();
const shows = usualShows();
const surface = new Surface(byId("surface"), byId("still"), byId("moving"), shows);
const strips = new Strips(byId("strips"), byId("strip"));
const health = new HealthView();
const log = new LogView();
const saving = new Saving();
const switches = new Switches(shows, () => redraw());
new TouchTable(moment, byId("moving"));

/** What the page knows now, for tests and for a look from the browser's console. */
const known = { moment, surface, strips, hello: null, health: null, state: "", moments: 0, bad: 0 };
window.cornertouchd = known;

let lastMomentMs = -Infinity;
let touched = false;
let shownHello = "";
let stripsSeen = false;
let waiting = false;
let latencyMs = NaN;

function redraw() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(draw);
}

function draw() {
  waiting = false;
  surface.draw(moment);
}

const connection = new Connection({
  onState(state, waitS, why = "") {
    known.state = state;
    NOTICES.refused[1] = why;
    document.body.dataset.state = state;
    say(byId("connection"), WORDS[state]);
    if (state === "token") byId("token").focus();
    if (state !== "live" && state !== "connecting") forget();
    lastMomentMs = performance.now();
    showNotice(waitS);
  },
  onHello(hello) {
    if (hello.calibrating) location.replace("/targets"); // there is no daemon to look at
    const text = JSON.stringify([hello.surface_mm, hello.cameras, hello.display, hello.version]);
    known.hello = hello;
    saving.setHello(hello);
    if (text === shownHello) return;
    shownHello = text;
    byId("version").textContent = hello.version;
    byId("source").textContent = hello.source_name;
    surface.setHello(hello);
    strips.setHello(hello);
    switches.setHello(hello);
    say(byId("surface-size"), hello.surface_mm.map((mm) => mm.toFixed(0)).join(" × ") + " mm");
  },
  onBinary(view) {
    try {
      const kind = view.getUint8(0);
      if (kind === KIND_MOMENT) takeMoment(view);
      else if (kind === KIND_STRIP) strips.take(readStrip(view));
    } catch (error) {
      if (!(error instanceof RangeError)) throw error;
      known.bad++;
    }
  },
  onText(message) {
    if (message.type === "hello") this.onHello(message);
    else if (message.type === "health") takeHealth(message);
    else if (message.type === "log") log.tell(message.lines);
    else if (message.type === "gone") connection.lose();
  },
});

function takeMoment(view) {
  moment.read(view);
  known.moments++;
  lastMomentMs = performance.now();
  surface.trails.add(moment);
  if (moment.touches > 0) touched = true;
  // a mean over about a second: single numbers cannot be read at 60 a second
  if (!Number.isNaN(moment.latencyMs)) {
    latencyMs = Number.isNaN(latencyMs) ? moment.latencyMs : latencyMs + (moment.latencyMs - latencyMs) / 40;
  }
  redraw();
}

function takeHealth(told) {
  known.health = told;
  health.tell(told);
  strips.tell(told);
  document.body.dataset.health = told.state;
  say(byId("rate"), told.frame_sets_per_s.toFixed(0));
}

/** What is gone is not shown: a fault lifts touches. */
function forget() {
  moment.clear();
  surface.reset();
  strips.clear();
  latencyMs = NaN;
  redraw();
}

function showNotice(waitS = 0) {
  const { state } = known;
  const notice = byId("notice");
  byId("token-form").hidden = state !== "token";
  byId("retry").hidden = !["gone", "full", "paused", "refused"].includes(state);
  const words = state === "token" ? null : (NOTICES[state] ?? silence());
  notice.hidden = words === null;
  if (words === null) return;
  say(byId("notice-title"), words[0]);
  const again = waitS ? ` Next attempt in ${Math.max(1, Math.round(waitS))} s.` : "";
  say(byId("notice-text"), words[1] + again);
}

/** Say why a live page shows no touches; null if it does. */
function silence() {
  if (known.hello?.cameras.length === 0) {
    return ["No cameras", "The daemon runs without cameras: see its settings and the log below."];
  }
  const cameras = known.health?.cameras ?? [];
  if (cameras.length > 0 && cameras.every((camera) => !camera.live)) {
    return ["No cameras", "All cameras are lost: see the problems told under Health."];
  }
  if (performance.now() - lastMomentMs > SILENT_AFTER_MS) {
    return ["Nothing is seen", "The daemon answers, but no pictures arrive."];
  }
  return touched ? null : ["No touches yet", "Put a finger on the surface."];
}

setInterval(() => {
  if (known.state !== "live" || document.hidden) return;
  showNotice();
  if (performance.now() - lastMomentMs > SILENT_AFTER_MS && moment.capturedAtS) {
    moment.clear();
    surface.reset();
    redraw();
  }
  const number = (value) => (Number.isNaN(value) ? "–" : value.toFixed(1));
  say(byId("touches"), String(moment.touches));
  say(byId("latency-now"), number(latencyMs));
  say(byId("skew"), number(moment.skewMs));
}, LOOK_EVERY_MS);

/** Say what the switch does. */
function nameTheme() {
  say(byId("theme"), document.documentElement.dataset.theme === "light" ? "Dark" : "Light");
}

/** Strips are sent while somebody sees them. */
function followStrips() {
  connection.wantStrips(stripsSeen && !document.hidden);
}

new IntersectionObserver(
  (entries) => {
    stripsSeen = entries.at(-1).isIntersecting;
    followStrips();
  },
  { rootMargin: "100px" }, // there before they are scrolled to
).observe(byId("strips"));
document.addEventListener("visibilitychange", followStrips);

byId("theme").addEventListener("click", switchTheme);
byId("retry").addEventListener("click", () => connection.connect());
byId("fullscreen").addEventListener("click", () => {
  if (document.fullscreenElement) document.exitFullscreen();
  else byId("surface-panel").requestFullscreen?.();
});
byId("help").addEventListener("click", () => byId("help-text").showModal());
byId("help-close").addEventListener("click", () => byId("help-text").close());
byId("token-form").addEventListener("submit", async (event) => {
  event.preventDefault();
  const accepted = await connection.offerToken(byId("token").value.trim()).catch(() => false);
  say(byId("token-refused"), accepted ? "" : "This token was refused.");
  if (!accepted) byId("token").select();
});
onColours(() => {
  nameTheme();
  redraw();
});
nameTheme();

// a token in the address has done its work: the next who looks over the shoulder need not see it
if (location.search) history.replaceState(null, "", location.pathname);
connection.connect();
