/**
 * Calibrations in words and numbers, without the DOM: what a device can be offered, what to ask for, how far one is.
 */

import { UNKNOWN, duration, plural, whole } from "./format.js";
import { fault } from "./lineup.js";
import { words } from "./looks.js";

export const PACES = ["slow", "normal", "fast", "run"];

/** What each published method asks of the walker, and what it can be limited by. */
const METHODS = {
  walk: {
    title: "Sampling walk",
    text: "Walk at one pace. Repeat it at other paces and tick them all below: they are pooled.",
    limits: ["steps", "seconds"],
    paced: true,
  },
  middle: {
    title: "Middle of a recording",
    text: "Walk as you usually do. Of what is recorded, 300 samples from the middle are used.",
    limits: ["seconds"],
    leastS: 10,
    paced: false,
  },
  slowest_walk: {
    title: "Slowest walk",
    text: "Walk as slowly as you ever do: what is slower will not count.",
    limits: ["steps", "seconds"],
    paced: false,
  },
};
/** A method that this page does not know yet. */
const OTHER = { text: "", limits: ["steps", "seconds"], paced: false };

/** The least, the usual and the most of each limit, as the server takes them. */
export const LIMITS = {
  steps: { low: 10, usual: 50, high: 1000, noun: "steps" },
  seconds: { low: 5, usual: 30, high: 600, noun: "seconds" },
};

/** Return what is known of a method: `{title, text, limits, paced}`. */
export function method(name) {
  return Object.hasOwn(METHODS, name) ? METHODS[name] : { ...OTHER, title: words(name) };
}

/** Return the calibrations that `device` can do, as `{counter, method}`. */
export function offers(counters, device) {
  return counters.filter((counter) => fault(counter, device) === null)
    .flatMap(({ name, calibrations = [] }) => calibrations.map((kind) => ({ counter: name, method: kind })));
}

/** Return the body of the request that begins a calibration. */
export function asked(offer, { limit, amount, pace }) {
  const { limits, paced } = method(offer.method);
  const by = limits.includes(limit) ? limit : limits[0];
  const number = amount.trim() === "" ? null : Number(amount);
  return { counter: offer.counter, method: offer.method, ...(paced ? { pace } : {}), [by]: number };
}

/** Return whether a refusal names what was typed, the steps or the seconds: "steps = 3: …" or "body.steps: …". */
export function blamesAmount(sentence) {
  return /^(\w+\.)*(steps|seconds)\b/.test(sentence);
}

/** Return how far a recording is: `{share, text}`, the share from 0 to 1. */
export function progress({ steps, seconds, steps_wanted: stepsWanted, seconds_wanted: secondsWanted }) {
  const [done, of] = stepsWanted == null ? [seconds, secondsWanted] : [steps, stepsWanted];
  const share = of ? Math.min(1, done / of) : 0;
  const walked = stepsWanted == null ? plural(steps ?? 0, "step") : `${whole(steps)} of ${plural(stepsWanted, "step")}`;
  const time = secondsWanted == null ? duration(seconds ?? 0)
    : `${whole(Math.min(Math.floor(seconds), secondsWanted))} of ${plural(secondsWanted, "second")}`;
  return { share, text: `${walked}, ${time}` };
}

/** Return the words beside the field for a limit: "10 to 1000 steps". */
export function range(name, limit) {
  const { low, high, noun } = LIMITS[limit];
  const { leastS = low } = method(name);
  return `${limit === "seconds" ? leastS : low} to ${high} ${noun}`;
}

/** Return what a calibration is called: "Sampling walk, slow". */
export function title({ method: name, pace }) {
  return [method(name).title, pace].filter(Boolean).join(", ");
}

/** Return the sentence of one that has ended. */
export function outcome({ state, detail, reason, params }) {
  if (state === "failed") return `Failed: ${reason ?? "no reason was given"}`;
  const learnt = Object.entries(params ?? {}).map(([key, value]) => `${words(key)} ${value}`).join(", ");
  return detail || learnt || UNKNOWN;
}

/** Return those that have ended, in groups that can be applied together: `[{counter, method, items}]`. */
export function ended(calibrations) {
  const groups = new Map();
  for (const one of calibrations.filter(({ state }) => state !== "recording")) {
    const key = `${one.counter} ${one.method}`;
    if (!groups.has(key)) groups.set(key, { counter: one.counter, method: one.method, items: [] });
    groups.get(key).items.push(one);
  }
  return [...groups.values()];
}
