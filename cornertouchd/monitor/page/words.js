/** Numbers as people read them. */

const DAY_S = 86400;
const MEGABYTE = 1e6;

export const whole = (value) => Math.round(value).toLocaleString("en").replaceAll(",", "\u202f");

export const percent = (share) => `${Math.round(100 * share)} %`;

export const megabytes = (bytes) => `${whole(bytes / MEGABYTE)} MB`;

export function duration(seconds) {
  const days = Math.floor(seconds / DAY_S);
  const clock = new Date(1000 * (seconds % DAY_S)).toISOString().slice(11, 19);
  return days ? `${days} d ${clock.slice(0, 5)}` : clock;
}

/** Return how long ago a moment written in ISO 8601 was, in words. */
export function ago(written) {
  const days = (Date.now() - Date.parse(written)) / 1000 / DAY_S;
  if (Number.isNaN(days)) return "";
  if (days < 1) return "today";
  return days < 2 ? "yesterday" : `${Math.floor(days)} days ago`;
}

/** Return a moment written in ISO 8601 as people here write it. */
export function moment(written) {
  const at = new Date(written);
  return Number.isNaN(at.getTime()) ? written : at.toLocaleString("sv-SE").slice(0, 16);
}

export function milliseconds(seconds) {
  const ms = 1000 * seconds;
  return ms < 10 ? `${ms.toFixed(1)} ms` : `${ms.toFixed(0)} ms`;
}
