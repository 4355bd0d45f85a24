/**
 * Choosing the counters of a device, without the DOM: what is ticked, who leads, which parameters differ.
 *
 * A choice is `{primary, entries: [{name, on, preset, params}]}`; every function returns a new one. One counter is
 * always on and the primary is always one of those.
 */

import { capital, plural, whole } from "./format.js";
import { words } from "./looks.js";

/** Return why a counter cannot count on `device`, as a sentence; null where nothing is known against it. */
export function fault({ name, sensors }, device) {
  const lacking = device.sensors ? sensors.filter((sensor) => !device.sensors.includes(sensor)) : [];
  const missing = lacking.length ? `Needs a ${lacking.join(" and a ")}, which this bracelet does not have.` : null;
  return device.counter_faults?.[name] ?? missing;
}

/** Return the choice that stands: every counter of `counters`, those of `lineup` ticked. */
export function standing(counters, lineup) {
  const running = new Map(lineup.map((choice) => [choice.name, choice]));
  const entries = counters.map(({ name }) => {
    const { preset = "tuned", params = {} } = running.get(name) ?? {};
    return { name, on: running.has(name), preset, params: { ...params } };
  });
  return { primary: lineup[0].name, entries };
}

/** Tick a counter or untick it; the last one stays, and the primary passes on to the next. */
export function ticked(choice, name, on) {
  const others = choice.entries.filter((entry) => entry.on && entry.name !== name);
  if (!on && others.length === 0) return choice;
  const primary = !on && choice.primary === name ? others[0].name : choice.primary;
  return { ...changed(choice, name, { on }), primary };
}

/** Let a counter lead; it is ticked with that. */
export function led(choice, name) {
  return { ...changed(choice, name, { on: true }), primary: name };
}

/** Change `{preset}`, `{params}` or `{on}` of one counter. */
export function changed(choice, name, change) {
  return { ...choice, entries: choice.entries.map((entry) => (entry.name === name ? { ...entry, ...change } : entry)) };
}

/** Return the text that a parameter's field shows. */
export function valueOf(parameter, { preset, params }) {
  return String(params[parameter.name] ?? parameter.presets[preset] ?? "");
}

/** Return `params` with what was typed; nothing typed, or the preset's own value, is no override. */
export function typed(parameter, { preset, params }, text) {
  const { [parameter.name]: _, ...rest } = params;
  const plain = text.trim().replace(",", ".");
  const number = plain === "" || Number.isNaN(Number(plain)) ? null : Number(plain);
  const value = parameter.options || number === null ? text.trim() : number;
  return value === "" || value === parameter.presets[preset] ? rest : { ...rest, [parameter.name]: value };
}

/**
 * Return whether a refusal names this parameter: as "autocorrelation.bout = 99: …", or as "bout = 99: …", which is that
 * of a counter whose `params` have it.
 */
export function named(sentence, counter, parameter, { params }) {
  if (sentence.startsWith(`${counter}.${parameter} = `)) return true;
  return sentence.startsWith(`${parameter} = `) && Object.hasOwn(params, parameter);
}

/** Return the lineup to ask the server for, the primary first. */
export function wanted({ primary, entries }) {
  const on = entries.filter((entry) => entry.on);
  const ordered = [...on.filter(({ name }) => name === primary), ...on.filter(({ name }) => name !== primary)];
  return ordered.map(({ name, preset, params }) => ({ name, preset, params }));
}

/** Return what a lineup `after` the present one, `before`, will change, as sentences. */
export function consequence(before, after, steps) {
  const [old, lead] = [before[0], after[0]];
  const known = new Map(before.map((one) => [one.name, one]));
  const said = [];
  if (!same(old, lead)) {
    const how = old.name === lead.name ? "counts with other parameters" : "counts";
    said.push(`A new segment begins: ${words(lead.name)} ${how}, and the count goes on from ${plural(steps, "step")}.`);
  }
  const fresh = after.slice(1).filter((one) => !known.has(one.name) || !same(known.get(one.name), one));
  const gone = before.filter(({ name }) => !after.some((one) => one.name === name));
  if (fresh.length) said.push(`${listed(fresh)} ${fresh.length > 1 ? "begin" : "begins"} at ${whole(0)}.`);
  if (gone.length) said.push(`${listed(gone)} ${gone.length > 1 ? "stop" : "stops"}.`);
  return said.length ? said.map(capital).join(" ") : "Nothing changes yet.";
}

function same(one, other) {
  const keys = new Set([...Object.keys(one.params), ...Object.keys(other.params)]);
  return one.name === other.name && one.preset === other.preset
    && [...keys].every((key) => String(one.params[key]) === String(other.params[key]));
}

function listed(choices) {
  const names = choices.map(({ name }) => words(name));
  return names.length < 2 ? names[0] : `${names.slice(0, -1).join(", ")} and ${names.at(-1)}`;
}
