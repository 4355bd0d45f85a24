/**
 * What the page knows of each device: a fold over the feed's messages, without the DOM.
 *
 * An entry keeps its identity when a device's id replaces its address, so its card and its trace stay.
 */

import { Trace } from "./trace.js";

export class Devices {
  #entries = new Map();
  #clockAheadMs = 0;

  /** Take one message; return true where something a card shows may have changed. Unknown types change nothing. */
  apply(message, nowMs) {
    if (message.type === "snapshot") return this.#snapshot(message);
    if (message.type === "device") return this.#put(message.value);
    const entry = this.#entries.get(message.device);
    if (!entry || !Object.hasOwn(TAKERS, message.type)) return false;
    TAKERS[message.type](entry, message, nowMs);
    return true;
  }

  /** Return the entries `{device, trace}` in the order in which they came. */
  get all() {
    return [...this.#entries.values()];
  }

  /** Return the server's clock, so that "for 8 s" is right where the viewer's clock is not. */
  serverNow() {
    return new Date(Date.now() - this.#clockAheadMs);
  }

  #snapshot({ at, devices }) {
    this.#clockAheadMs = Date.now() - Date.parse(at);
    const ids = new Set(devices.map(({ id }) => id));
    for (const device of devices) this.#put(device);
    for (const id of this.#entries.keys()) if (!ids.has(id)) this.#entries.delete(id);
    return true;
  }

  #put(device) {
    // Known already, and heard under a new address: the card of that address was the same device's.
    if (device.id !== device.address && this.#entries.has(device.id)) this.#entries.delete(device.address);
    const before = this.#entries.get(device.id) ?? this.#renamed(device);
    if (!before) {
      this.#entries.set(device.id, { device, trace: new Trace() });
      return true;
    }
    const { reboots, session_since: since } = before.device; // a service that was restarted begins a session anew
    if (device.reboots !== reboots || device.session_since !== since) before.trace.reset();
    before.device = device;
    return true;
  }

  /** Find the card that stood for this device under its address, and put it under the new id in the same place. */
  #renamed({ id, address }) {
    const old = [...this.#entries].find(([, entry]) => entry.device.address === address)?.[0];
    if (old === undefined) return undefined;
    this.#entries = new Map([...this.#entries].map(([key, entry]) => [key === old ? id : key, entry]));
    return this.#entries.get(id);
  }
}

const TAKERS = {
  step(entry, message, nowMs) {
    const { device, trace } = entry;
    const counters = { ...device.counters, [message.counter]: message.steps };
    entry.device = { ...device, counters };
    trace.addStep(message, nowMs, message.counter === device.primary);
    if (message.counter !== device.primary) return;
    const steps = device.steps + 1; // the device's count, which goes on where the counter's own begins anew
    entry.device = { ...device, counters, steps, steps_now: Math.max(device.steps_now, steps) };
  },
  tentative(entry, message, nowMs) {
    entry.trace.addTentative(message, nowMs, entry.device.primary);
  },
  segment(entry, { primary, steps }) {
    entry.device = { ...entry.device, primary, steps, steps_now: steps, gait: null, refused: {} };
  },
  counting(entry, { steps, steps_now, cadence_spm, gait }) {
    entry.device = { ...entry.device, steps, steps_now, cadence_spm, gait };
  },
  signal(entry, message, nowMs) {
    entry.trace.addSignal(message, nowMs);
  },
  state(entry, { state, reason, at }) {
    entry.device = { ...entry.device, state, reason, since: at };
  },
  gap(entry, message) {
    entry.trace.addGap(message);
  },
  reboot(entry) {
    entry.trace.reset();
    entry.device = { ...entry.device, reboots: entry.device.reboots + 1 };
  },
};
