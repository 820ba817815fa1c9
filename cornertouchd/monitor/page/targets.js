/** What a running `cornertouchd calibrate --page` asks for: as a plan, or at its true place. */

import { byId, make, say } from "./elements.js";
import { colours, onColours, switchTheme, textScale } from "./theme.js";

const FULL_TURN = 2 * Math.PI;
const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 4000;
const MARGIN_PX = 24;
const TARGET_PX = 26;
const DONE = "done";

const TITLES = {
  boards: "Boards",
  cameras: "Cameras",
  empty: "Empty strip",
  taps: "Taps",
  scribble: "Scribble",
  check: "Check",
  display: "Display",
};

/** How the picture's axes lie along those of the surface: swapped, x backwards, y backwards. */
const TURNED = {
  0: [false, false, false],
  90: [true, false, true],
  180: [false, true, true],
  270: [true, true, false],
};

const canvas = byId("guide");
const known = { guide: null, state: "connecting", told: 0 };
window.cornertouchd = known;

let fills = false;
let waitMs = FIRST_WAIT_MS;

/** Return the place on the screen, in CSS pixels, of one on the surface. */
function placeOf(guide, xMm, yMm) {
  const [width, height] = guide.surface_mm;
  if (fills) {
    const [u, v] = shareOfPicture(guide.display, width, height, xMm, yMm);
    return [u * canvas.clientWidth, v * canvas.clientHeight];
  }
  const { left, top, scale } = planOf(guide);
  return [left + xMm * scale, top + yMm * scale];
}

function shareOfPicture(display, width, height, xMm, yMm) {
  if (!display) return [xMm / width, yMm / height];
  const u = (xMm - display.left_mm) / display.width_mm;
  const v = (yMm - display.top_mm) / display.height_mm;
  const [swapped, xBackwards, yBackwards] = TURNED[display.rotation_deg];
  const [x, y] = swapped ? [v, u] : [u, v];
  return [xBackwards !== display.mirror ? 1 - x : x, yBackwards ? 1 - y : y];
}

/** Return where the plan of the surface stands between head and foot of the page. */
function planOf(guide) {
  const [width, height] = guide.surface_mm;
  const from = document.querySelector("header").getBoundingClientRect().bottom + MARGIN_PX;
  const to = document.querySelector("footer").getBoundingClientRect().top - MARGIN_PX;
  const room = Math.max(60, to - from);
  const scale = Math.min((canvas.clientWidth - 2 * MARGIN_PX) / width, room / height);
  const left = (canvas.clientWidth - width * scale) / 2;
  return { left, top: from + (room - height * scale) / 2, scale };
}

function draw() {
  const ratio = window.devicePixelRatio || 1;
  canvas.width = Math.round(canvas.clientWidth * ratio);
  canvas.height = Math.round(canvas.clientHeight * ratio);
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  const { guide } = known;
  if (guide === null || guide.step === "cameras" || guide.step === "boards") return;
  if (!fills) drawFrame(context, guide);
  if (guide.visited) drawVisited(context, guide);
  if (guide.step === "display") drawCorners(context, guide);
  for (const [xMm, yMm] of guide.tapped_mm) drawDot(context, guide, xMm, yMm, colours.good, 5);
  if (guide.target_mm) drawTarget(context, guide);
  if (guide.finger_mm) drawDot(context, guide, ...guide.finger_mm, colours.warn, 10);
}

function drawFrame(context, guide) {
  const { left, top, scale } = planOf(guide);
  const [width, height] = guide.surface_mm;
  context.fillStyle = colours.surface;
  context.fillRect(left, top, width * scale, height * scale);
  context.strokeStyle = colours["line-strong"];
  context.lineWidth = 2;
  context.strokeRect(left, top, width * scale, height * scale);
  const corners = [[0, 0], [1, 0], [1, 1], [0, 1]];
  context.font = `600 ${12 * textScale()}px system-ui, sans-serif`;
  context.textBaseline = "middle";
  corners.forEach(([u, v], i) => {
    context.fillStyle = colours.cameras[i];
    context.textAlign = u ? "right" : "left";
    const inside = 10 * textScale();
    const x = left + u * width * scale + (u ? -inside : inside);
    context.fillText(`C${i + 1}`, x, top + v * height * scale + (v ? -inside : inside));
  });
}

function drawVisited(context, guide) {
  const { rows, columns, cells } = guide.visited;
  const [width, height] = guide.surface_mm;
  context.fillStyle = colours.good;
  context.globalAlpha = 0.35;
  for (let i = 0; i < cells.length; i++) {
    if (cells[i] !== "1") continue;
    const row = Math.floor(i / columns);
    const column = i % columns;
    const [x0, y0] = placeOf(guide, (column / columns) * width, (row / rows) * height);
    const [x1, y1] = placeOf(guide, ((column + 1) / columns) * width, ((row + 1) / rows) * height);
    context.fillRect(Math.min(x0, x1), Math.min(y0, y1), Math.abs(x1 - x0) + 0.5, Math.abs(y1 - y0) + 0.5);
  }
  context.globalAlpha = 1;
}

/** Mark the corners of the picture: where they are on the surface is what will be found out. */
function drawCorners(context, guide) {
  const inset = guide.inset;
  const shares = [[inset, inset], [1 - inset, inset], [1 - inset, 1 - inset], [inset, 1 - inset]];
  shares.forEach(([u, v], i) => {
    let [x, y] = [u * canvas.clientWidth, v * canvas.clientHeight];
    if (!fills) {
      const { left, top, scale } = planOf(guide);
      x = left + u * guide.surface_mm[0] * scale;
      y = top + v * guide.surface_mm[1] * scale;
    }
    if (i + 1 === guide.number) cross(context, x, y, guide.held);
    else disc(context, x, y, 6, i + 1 < guide.number ? colours.good : colours["line-strong"]);
  });
}

function drawTarget(context, guide) {
  const [x, y] = placeOf(guide, ...guide.target_mm);
  cross(context, x, y, guide.held);
}

/** Draw the place to touch; its ring closes while the finger is held there. */
function cross(context, x, y, held) {
  const size = TARGET_PX * textScale();
  context.strokeStyle = colours.accent;
  context.lineWidth = 2;
  context.beginPath();
  context.moveTo(x - size, y);
  context.lineTo(x + size, y);
  context.moveTo(x, y - size);
  context.lineTo(x, y + size);
  context.stroke();
  context.beginPath();
  context.arc(x, y, size * 0.62, 0, FULL_TURN);
  context.stroke();
  context.strokeStyle = colours.warn;
  context.lineWidth = 6;
  context.beginPath();
  context.arc(x, y, size, -FULL_TURN / 4, FULL_TURN * (held - 0.25));
  if (held > 0) context.stroke();
}

function drawDot(context, guide, xMm, yMm, colour, radius) {
  const [x, y] = placeOf(guide, xMm, yMm);
  disc(context, x, y, radius * textScale(), colour);
}

function disc(context, x, y, radius, colour) {
  context.fillStyle = colour;
  context.beginPath();
  context.arc(x, y, radius, 0, FULL_TURN);
  context.fill();
}

function tell(guide) {
  known.guide = guide;
  known.told++;
  document.body.dataset.step = guide.step;
  const at = guide.steps.indexOf(guide.step);
  byId("steps").replaceChildren(
    ...guide.steps.map((step, i) => {
      const item = make("li", i < at || guide.step === DONE ? "past" : "", TITLES[step] ?? step);
      if (i === at) item.setAttribute("aria-current", "step");
      return item;
    }),
  );
  say(byId("hint"), sentence(guide.missing.length ? "see to the cameras" : guide.hint));
  say(byId("where"), whereTo(guide));
  byId("progress").value = guide.held || guide.progress;
  byId("findings").replaceChildren(...findings(guide));
  draw();
}

const sentence = (text) => text.charAt(0).toUpperCase() + text.slice(1);

function whereTo(guide) {
  const words = guide.of ? [`${guide.number} of ${guide.of}`] : [];
  if (guide.name) words.push(guide.name);
  if (guide.target_mm) {
    words.push(`${guide.target_mm[0]} mm from the left, ${guide.target_mm[1]} mm from the top`);
  }
  if (guide.visited) words.push(`${Math.round(100 * guide.progress)} %`);
  return words.join(" · ");
}

/** Return what is to be said of the cameras while they are looked at. */
function findings(guide) {
  const missing = guide.missing.map((text) => make("li", "bad", text));
  if (guide.step !== "cameras") return missing;
  const found = guide.checks.flatMap((check) =>
    check.findings.length
      ? check.findings.map((one) =>
          make("li", one.severity, make("b", "", check.camera), ` ${one.severity}: ${one.text}`))
      : [make("li", "good", make("b", "", check.camera), " good")],
  );
  return [...missing, ...found];
}

async function connect() {
  const hello = await fetch("/api/hello", { cache: "no-store" }).catch(() => null);
  if (hello?.status === 401) {
    location.replace("/"); // which asks for the token, and leads back
    return;
  }
  const scheme = location.protocol === "https:" ? "wss:" : "ws:";
  const socket = new WebSocket(`${scheme}//${location.host}/guide`);
  socket.onopen = () => setState("live");
  socket.onmessage = (event) => {
    waitMs = FIRST_WAIT_MS;
    tell(JSON.parse(event.data));
  };
  socket.onclose = () => {
    setState("gone");
    setTimeout(connect, waitMs);
    waitMs = Math.min(2 * waitMs, LONGEST_WAIT_MS);
  };
}

function setState(state) {
  known.state = state;
  document.body.dataset.state = state;
  if (state !== "gone" || known.guide?.step === DONE) return;
  known.guide = null;
  byId("steps").replaceChildren();
  byId("findings").replaceChildren();
  say(byId("hint"), "No calibration runs");
  say(byId("where"), "Start one with: cornertouchd calibrate --page. This page follows by itself.");
  byId("progress").value = 0;
  draw();
}

/** Fill the screen, so that targets stand where they are to be touched; or be a plan again. */
async function fill(on) {
  fills = on;
  document.body.classList.toggle("fills", on);
  byId("fill").setAttribute("aria-pressed", String(on));
  byId("fill-text").hidden = !on;
  if (on && !document.fullscreenElement) {
    await document.documentElement.requestFullscreen?.().catch(() => {});
  } else if (!on && document.fullscreenElement) {
    await document.exitFullscreen();
  }
  draw();
}

function nameTheme() {
  say(byId("theme"), document.documentElement.dataset.theme === "light" ? "Dark" : "Light");
}

byId("fill").addEventListener("click", () => fill(!fills));
byId("theme").addEventListener("click", switchTheme);
document.addEventListener("fullscreenchange", () => {
  if (!document.fullscreenElement && fills) fill(false);
});
onColours(() => {
  nameTheme();
  draw();
});
nameTheme();
new ResizeObserver(draw).observe(canvas);
connect();
