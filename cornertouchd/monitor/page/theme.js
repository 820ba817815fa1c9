/** Dark or light: as the system says, or as the switch says; and the colours for canvases. */

import { keep, kept } from "./keeping.js";

const listeners = [];
const system = window.matchMedia("(prefers-color-scheme: light)");

export const reducedMotion = window.matchMedia("(prefers-reduced-motion: reduce)");

/** Colours of the canvases, filled from the style sheet. */
export const colours = {};
const NAMES = [
  "surface", "line", "line-strong", "text", "muted", "accent", "good", "warn", "bad",
  "profile", "reference", "masked", "edge",
];
const CAMERAS = 4;
const SMALL_TEXT_PX = 14;
export const TOUCH_COLOURS = 8;

function read() {
  const style = getComputedStyle(document.documentElement);
  for (const name of NAMES) colours[name] = style.getPropertyValue(`--${name}`).trim();
  colours.cameras = Array.from({ length: CAMERAS }, (_, i) =>
    style.getPropertyValue(`--camera-${i + 1}`).trim(),
  );
  colours.touches = Array.from({ length: TOUCH_COLOURS }, (_, i) =>
    style.getPropertyValue(`--touch-${i + 1}`).trim(),
  );
}

function apply() {
  const chosen = kept("theme", "");
  const light = chosen ? chosen === "light" : system.matches;
  document.documentElement.dataset.theme = light ? "light" : "dark";
  read();
  for (const listener of listeners) listener();
}

/** Return how much larger text is than on a small screen: canvases follow. */
export function textScale() {
  return parseFloat(getComputedStyle(document.documentElement).fontSize) / SMALL_TEXT_PX;
}

/** Call `listener` whenever the colours have changed. */
export function onColours(listener) {
  listeners.push(listener);
}

export function switchTheme() {
  keep("theme", document.documentElement.dataset.theme === "light" ? "dark" : "light");
  apply();
}

system.addEventListener("change", apply);
apply();
