/**
 * Trials in words and numbers, without the DOM: the columns of the paper's table, and means over it.
 */

import { UNKNOWN, whole } from "./format.js";
import { words } from "./looks.js";

/** Columns of the table, as in Table 4 of Wang 2018: the heading, and the text of a row's cell. */
export const COLUMNS = [
  { key: "device", title: "Device" },
  { key: "wrist", title: "Wrist" },
  { key: "counter", title: "Counter" },
  { key: "item", title: "Test item" },
  { key: "truth", title: "True steps", number: true },
  { key: "steps", title: "Counted", number: true },
  { key: "error", title: "Error", number: true },
  { key: "accuracy", title: "Accuracy", number: true },
];

/** The status of an answer that refuses what was typed. */
export const REFUSED = 422;

/** Return a count with its sign; a dash where it is not known. */
export function signed(value) {
  if (value == null) return UNKNOWN;
  return value > 0 ? `+${whole(value)}` : whole(value).replace("-", "−");
}

/** Return an accuracy in percent as the paper prints it; a dash where it is not known. */
export function accuracy(percent) {
  return percent == null ? UNKNOWN : `${percent.toFixed(2).replace("-", "−")}\u00a0%`;
}

/** Return the texts of a trial's rows, by the keys of COLUMNS; `name(id)` says what a device is called. */
export function cells(trial, name) {
  return trial.rows.map((row) => ({
    device: name(row.device),
    wrist: row.wrist || UNKNOWN,
    counter: words(row.counter),
    item: trial.name || `Trial ${trial.number}`,
    truth: whole(trial.true_steps),
    steps: whole(row.steps),
    error: signed(row.error),
    accuracy: accuracy(row.accuracy_percent),
    note: row.note || "",
  }));
}

/** Return the mean accuracy in percent of all rows of `trials` that have one: `{percent, rows}`. */
export function meanAccuracy(trials, keep = () => true) {
  const known = trials.flatMap(({ rows }) => rows)
    .filter((row) => row.accuracy_percent != null && keep(row))
    .map((row) => row.accuracy_percent);
  const sum = known.reduce((total, percent) => total + percent, 0);
  return { percent: known.length ? sum / known.length : null, rows: known.length };
}

/** Return the mean accuracy of each device with its counter, and of all, as `{title, text}`. */
export function means(trials, name) {
  const rows = trials.flatMap((trial) => trial.rows);
  const kinds = new Map(rows.map((row) => [[row.device, row.wrist, row.counter].join("\n"), row]));
  const each = [...kinds.values()].map(({ device, wrist, counter }) => {
    const same = (row) => row.device === device && row.wrist === wrist && row.counter === counter;
    const where = [name(device), wrist, words(counter)].filter(Boolean).join(", ");
    return { title: where, ...meanAccuracy(trials, same) };
  });
  return [...each, { title: "All rows", ...meanAccuracy(trials) }]
    .filter(({ percent }) => percent !== null)
    .map(({ title, percent, rows: count }) => ({ title, text: accuracy(percent), rows: count }));
}

/** Return the number that was typed as the true steps: null where nothing was, the text itself where it is none. */
export function trueSteps(text) {
  const plain = text.replace(/[\s,]/g, "");
  if (plain === "") return null;
  return Number.isNaN(Number(plain)) ? text : Number(plain);
}

/** Return the wrist that a device's name tells of, "left" or "right"; null where it tells of none. */
export function wristOf({ name }) {
  return /\b(left|right)\b/i.exec(name ?? "")?.[1].toLowerCase() ?? null;
}

/** Return what a trial that is not done waits for. */
export function standing({ state }) {
  return state === "settling" ? "Deciding the last steps…" : "Walk now: both count.";
}
