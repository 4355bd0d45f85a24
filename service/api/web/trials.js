/**
 * Comparing two wrists: two devices walk the same walk, both counts stand beside each other and beside the true one.
 *
 * Shown once two bracelets are there, or a trial is. The server is asked once a second while a trial runs, else every
 * five seconds.
 */

import { request } from "./api.js";
import { el, setText } from "./dom.js";
import { Poll } from "./poll.js";
import { TrialForm } from "./trial_form.js";
import { TrialRun } from "./trial_run.js";
import { TrialTable } from "./trial_table.js";

const WATCH_MS = 1_000;
const REST_MS = 5_000;

export class Trials {
  #root;
  #start = new TrialForm((body) => this.#change("POST", "api/v1/trials", body));
  #running = el("div", { className: "runs" });
  #cards = new Map();
  #table;
  #error = el("p", { className: "notice bad", role: "alert", hidden: true });
  #poll = new Poll(() => this.#ask());
  #devices = [];
  #busy = new Set();
  #known = 0;
  #cut = false;
  #polling = false;

  /** `root` is the page's <details> for it. */
  constructor(root) {
    this.#root = root;
    this.#table = new TrialTable({
      truth: (number, steps) => this.#change("PATCH", `api/v1/trials/${number}`, { true_steps: steps }),
      remove: (number) => this.#change("DELETE", `api/v1/trials/${number}`),
    });
    root.append(this.#start.element, this.#error, this.#running, this.#table.element);
  }

  /** Take the devices as they stand now. */
  show(devices) {
    this.#devices = devices;
    this.#start.show(devices, this.#busy);
    this.#root.hidden = devices.length < 2 && this.#known === 0;
    if (devices.length > 1 && !this.#polling) {
      this.#polling = true;
      this.#poll.now();
    }
  }

  async #ask() {
    const { value, error } = await request("api/v1/trials");
    if (error) {
      this.#fail(error);
      this.#cut = true;
      return REST_MS;
    }
    if (this.#cut) this.#error.hidden = true;
    this.#cut = false;
    return this.#fill(value.items);
  }

  #fill(trials) {
    const open = trials.filter(({ state }) => state !== "done");
    if (open.length && this.#known === 0) this.#root.open = true;
    this.#known = trials.length;
    for (const [number, card] of this.#cards) {
      if (open.some((trial) => trial.number === number)) continue;
      card.element.remove();
      this.#cards.delete(number);
    }
    for (const trial of open) this.#card(trial.number).show(trial, (id) => this.#name(id));
    this.#busy = new Set(open.flatMap(({ rows }) => rows.map(({ device }) => device)));
    this.#start.show(this.#devices, this.#busy);
    this.#table.show(trials.filter(({ state }) => state === "done"), (id) => this.#name(id));
    return open.length ? WATCH_MS : REST_MS;
  }

  #card(number) {
    if (!this.#cards.has(number)) {
      const path = `api/v1/trials/${number}`;
      const card = new TrialRun({
        finish: (steps) => this.#change("POST", `${path}/finish`, steps === null ? {} : { true_steps: steps }),
        cancel: () => this.#change("DELETE", path),
      });
      this.#cards.set(number, card);
      this.#running.append(card.element);
    }
    return this.#cards.get(number);
  }

  #name(id) {
    const device = this.#devices.find((one) => one.id === id);
    const twins = this.#devices.filter(({ name }) => name === device?.name).length > 1;
    return !device?.name ? id : twins ? `${device.name} ${id}` : device.name;
  }

  #fail(error) {
    setText(this.#error, error);
    this.#error.hidden = false;
    this.#cut = false;
  }

  /** Ask for a change; resolves to `{status, error}` as `request` does. */
  async #change(method, path, body) {
    this.#error.hidden = true;
    const { status, error } = await request(path, { method, body });
    if (error) this.#fail(error);
    this.#poll.now();
    return { status, error };
  }
}
