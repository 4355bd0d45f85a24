/**
 * What a card says of a device's primary counter, without the DOM: its counts, and why it has none.
 *
 * A primary that cannot count has not counted nothing: where no step was ever counted its numbers are dashes, never a
 * zero that looks like rest. What was counted before it failed stays.
 */

import { UNKNOWN, whole } from "./format.js";

/** Return why the primary cannot count, in the server's words; null where it can. */
export function primaryFault({ primary, counter_faults: faults }) {
  return faults?.[primary] ?? null;
}

/** Return the state that a card shows: "faulted" is a device that streams to a primary that cannot count. */
export function shownState(device) {
  return device.state === "streaming" && primaryFault(device) !== null ? "faulted" : device.state;
}

/** Return the counts as texts: `{now, confirmed, pending}`; `pending` is a number. */
export function counts(device) {
  const { steps, steps_now: now } = device;
  if (primaryFault(device) !== null && now === 0) return { now: UNKNOWN, confirmed: UNKNOWN, pending: 0 };
  return { now: whole(now), confirmed: whole(steps), pending: Math.max(0, now - steps) };
}

/** Return the sentence of a primary that cannot count; empty where it can. */
export function faultNotice(device) {
  const why = primaryFault(device);
  return why === null ? "" : `Steps are not counted: ${why}.`;
}

/** Return the count as it is read aloud: "42 steps", "not counting". */
export function spokenCount(device) {
  const { now } = counts(device);
  return now === UNKNOWN ? "not counting" : `${now} steps`;
}
