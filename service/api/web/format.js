/**
 * Numbers and times as the page shows them.
 *
 * Times arrive in UTC and are shown in the viewer's zone, which is always named. A value that is not known is a dash.
 */

export const UNKNOWN = "–";

const WHOLE = new Intl.NumberFormat("en", { maximumFractionDigits: 0 });

/** Return `value` rounded, with thousands separated; a dash where it is null. */
export function whole(value) {
  return value == null ? UNKNOWN : WHOLE.format(value);
}

/** Return `value` with `digits` decimals and its unit; a dash where it is null. */
export function measured(value, digits, unit) {
  return value == null ? UNKNOWN : `${value.toFixed(digits).replace("-", "−")}\u00a0${unit}`;
}

/** Return ["50.0105", "± 0.0009"]: `value` with the digits that its uncertainty leaves, `signed` with a plus too. */
export function uncertain(value, within, signed = false) {
  const digits = known(within);
  return [decimal(value, digits, signed), `±\u00a0${decimal(Math.ceil(within * 10 ** digits) / 10 ** digits, digits)}`];
}

/** Return by how many ppm `value` is off `nominal`, with the digits that `within` leaves; null where it may not be. */
export function deviation(value, nominal, within) {
  if (Math.abs(value - nominal) <= within) return null;
  return `${decimal(1e6 * (value / nominal - 1), known((1e6 * within) / nominal), true)}\u00a0ppm`;
}

/** Return to which decimal what is uncertain by so much is worth telling; −1 for tens. */
function known(within) {
  return -Math.floor(Math.log10(within));
}

function decimal(value, digits, signed = false) {
  const tens = 10 ** Math.max(0, -digits);
  const places = Math.max(0, digits);
  return (Math.round(value / tens / 10 ** -places) * 10 ** -places * tens).toLocaleString("en", {
    minimumFractionDigits: places, maximumFractionDigits: places, signDisplay: signed ? "exceptZero" : "negative",
  }).replace("-", "−");
}

/** Return `text` with a capital at its head. */
export function capital(text) {
  return text.slice(0, 1).toUpperCase() + text.slice(1);
}

/** Return "1 gap" or "3 gaps". */
export function plural(count, noun) {
  return `${whole(count)} ${noun}${count === 1 ? "" : "s"}`;
}

/** Return the share of `part` in `part + rest` in percent, with one decimal where it is under ten. */
export function percent(part, rest) {
  const all = part + rest;
  if (!all) return UNKNOWN;
  const share = (100 * part) / all;
  return `${share.toFixed(share > 0 && share < 10 ? 1 : 0)}\u00a0%`;
}

/** Return how long `seconds` is, in the largest unit that says enough: "8 s", "3 min", "2 h 5 min". */
export function duration(seconds) {
  const s = Math.max(0, Math.floor(seconds));
  if (s < 60) return `${s}\u00a0s`;
  if (s < 3600) return `${Math.floor(s / 60)}\u00a0min`;
  return `${Math.floor(s / 3600)}\u00a0h ${Math.floor((s % 3600) / 60)}\u00a0min`;
}

/** Return the local wall clock with its zone, and the date where it is not today's: "14:03:12 GMT+2". */
export function localTime(iso, now = new Date()) {
  const at = new Date(iso);
  const date = at.toDateString() === now.toDateString() ? {} : { day: "numeric", month: "short" };
  return new Intl.DateTimeFormat("en-GB", {
    ...date, hour: "2-digit", minute: "2-digit", second: "2-digit", timeZoneName: "short",
  }).format(at);
}

/** Return the viewer's zone by name and offset: "Europe/Zurich (GMT+2)". */
export function zone(now = new Date()) {
  const part = new Intl.DateTimeFormat("en-GB", { timeZoneName: "shortOffset" })
    .formatToParts(now).find(({ type }) => type === "timeZoneName");
  const name = Intl.DateTimeFormat().resolvedOptions().timeZone;
  return name === "UTC" ? name : `${name} (${part.value})`;
}
