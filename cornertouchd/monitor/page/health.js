/** How the daemon does: in words, and what it counts. */

import { byId, fillRows, make, say } from "./elements.js";
import { ago, duration, megabytes, milliseconds, moment, percent, whole } from "./words.js";

/** Columns of the cameras' table: heading, what it says of a camera, whether that is suspect. */
const CAMERA_COLUMNS = [
  ["per s", (camera) => camera.pictures_per_s.toFixed(0), () => false],
  ["lost", (camera) => whole(camera.lost), (camera) => camera.lost > 0],
  ["damaged", (camera) => whole(camera.damaged), (camera) => camera.damaged > 0],
  ["faults", (camera) => whole(camera.faults), (camera) => camera.faults > 0],
  ["reopened", (camera) => whole(camera.reopened), (camera) => camera.reopened > 0],
  ["resets", (camera) => whole(camera.resets), (camera) => camera.resets > 0],
  ["masked", (camera) => whole(camera.masked_columns), (camera) => camera.masked_columns > 0],
  ["clipped", (camera) => shareOf(camera.strip), (camera) => camera.strip?.saturated_share > 0.15],
];

const shareOf = (strip) => (strip ? percent(strip.saturated_share) : "–");

export class HealthView {
  constructor() {
    const headings = ["camera", ...CAMERA_COLUMNS.map(([heading]) => heading)];
    byId("cameras-head").append(make("tr", "", ...headings.map(headingCell)));
  }

  tell(health) {
    this.tellState(health);
    this.tellCameras(health.cameras);
    this.tellDestinations(health.destinations);
    this.tellFacts(health);
    this.tellLatency(health);
  }

  tellState(health) {
    const state = byId("health-state");
    say(state, health.state === "healthy" ? "All is well" : "Something is missing");
    state.className = `verdict ${health.state}`;
    say(byId("up"), `up ${duration(health.up_s)}`);
    this.list("problems", health.problems);
    this.list("hints", health.hints);
  }

  list(id, lines) {
    const place = byId(id);
    const said = [...place.children].map((item) => item.textContent);
    if (said.length === lines.length && said.every((line, i) => line === lines[i])) return;
    place.replaceChildren(...lines.map((line) => make("li", "", line)));
  }

  tellCameras(cameras) {
    fillRows(
      byId("cameras-body"),
      cameras.map((camera) => [
        camera.live ? camera.id : [`${camera.id} lost`, "bad"],
        ...CAMERA_COLUMNS.map(([, words, isSuspect]) => [
          words(camera),
          isSuspect(camera) ? "warn" : "",
        ]),
      ]),
    );
  }

  tellDestinations(destinations) {
    fillRows(
      byId("destinations-body"),
      destinations.map((to) => [
        `${to.host}:${to.port}`,
        whole(to.packets_sent),
        [whole(to.errors), to.errors ? "warn" : ""],
        to.fault ? [to.fault, "warn"] : "",
      ]),
    );
  }

  tellFacts(health) {
    const { fusion, light } = health;
    const calibrated = `${moment(health.calibrated_at)} (${ago(health.calibrated_at)})`;
    const facts = [
      ["Frame sets", `${health.frame_sets_per_s.toFixed(0)}/s, ${whole(fusion.frame_sets)} so far`],
      ["Incomplete", `${whole(fusion.partial)} partial, ${whole(fusion.skipped)} skipped, ` +
        `${whole(fusion.dropped)} dropped`],
      ["Touches", `${fusion.touches_now} now, ${whole(fusion.touches_begun)} so far; ` +
        `${whole(fusion.ghosts)} ghosts refused`],
      ["Calibrated", `${calibrated}, residual ${health.residual_mm.toFixed(2)} mm`],
      ["LED frame", light ? lightWords(light) : "not connected to this daemon"],
      ["Daemon", `${percent(health.cpu_share)} of a processor, ` +
        megabytes(health.process.memory_bytes)],
    ];
    byId("facts").replaceChildren(
      ...facts.flatMap(([name, text]) => [make("dt", "", name), make("dd", "", text)]),
    );
  }

  tellLatency(health) {
    const { bounds_s: bounds, counts } = health.fusion.latency;
    const most = Math.max(1, ...counts);
    const total = counts.reduce((sum, count) => sum + count, 0);
    byId("latency-bars").replaceChildren(
      ...counts.map((count, i) => {
        const upTo = i < bounds.length ? `up to ${milliseconds(bounds[i])}` : "more";
        const bar = make("i", "bar");
        bar.style.height = `${count ? Math.max(2, (100 * count) / most) : 0}%`;
        const column = make("span", "column", bar);
        column.title = `${upTo}: ${whole(count)}`;
        return column;
      }),
    );
    say(byId("latency-from"), "0");
    say(byId("latency-to"), `> ${milliseconds(bounds.at(-1))}`);
    const half = quantile(bounds, counts, total, 0.5);
    const high = quantile(bounds, counts, total, 0.99);
    say(byId("latency-words"), total ? `median ${half}, 99 % within ${high}` : "nothing sent yet");
    byId("latency-bars").setAttribute("aria-label", `Latency: ${byId("latency-words").textContent}`);
  }
}

function headingCell(text) {
  const cell = make("th", "", text);
  cell.scope = "col";
  return cell;
}

function quantile(bounds, counts, total, share) {
  let sum = 0;
  for (let i = 0; i < bounds.length; i++) {
    sum += counts[i];
    if (sum >= share * total) return milliseconds(bounds[i]);
  }
  return `more than ${milliseconds(bounds.at(-1))}`;
}

function lightWords(light) {
  const said = [`${light.controller || "lost"} at ${light.port}`, light.pattern];
  said.push(`levels ${light.levels.join("/")}${light.dimmed ? ", dimmed" : ""}`);
  if (light.temperature_c !== null) said.push(`${light.temperature_c.toFixed(0)} °C`);
  return [...said, ...light.faults].join("; ");
}
