/**
 * Comparing two wrists: two devices walk the same walk, both counts stand beside each other and beside the true one.
 *
 * Shown once two bracelets are there, or a trial is. The server is asked once a second while a trial runs, else every
 * five seconds.
 */

import { request } from "./api.js";
import { labelled } from "./calibration_form.js";
import { el, freshId, setText } from "./dom.js";
import { whole } from "./format.js";
import { Poll } from "./poll.js";
import { TrialTable } from "./trial_table.js";
import { standing, trueSteps } from "./trial_words.js";

const WATCH_MS = 1_000;
const REST_MS = 5_000;
const ITEMS = ["slow walk", "normal walk", "fast walk", "run", "upstairs", "downstairs"];
const WRISTS = ["left", "right"];

export class Trials {
  #root;
  #start = new StartForm((body) => this.#change("POST", "api/v1/trials", body));
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
      const finish = (steps) => this.#change("POST", `api/v1/trials/${number}/finish`, steps === null ? {} : { true_steps: steps });
      const card = new RunningTrial({ finish, cancel: () => this.#change("DELETE", `api/v1/trials/${number}`) });
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

  async #change(method, path, body) {
    this.#error.hidden = true;
    const { error } = await request(path, { method, body });
    if (error) this.#fail(error);
    this.#poll.now();
  }
}

/** Which two devices, on which wrists, and what is tested. */
class StartForm {
  element;
  #sides;
  #item;
  #shown = "";

  constructor(start) {
    const list = el("datalist", { id: freshId("items") }, ...ITEMS.map((value) => el("option", { value })));
    this.#sides = ["First", "Second"].map((which, i) => {
      const device = el("select");
      const wrist = el("select", {}, ...WRISTS.map((side) => el("option", { value: side }, side)));
      wrist.value = WRISTS[i];
      return { device, wrist, rows: [labelled(`${which} bracelet`, device), labelled("Wrist", wrist)] };
    });
    this.#item = el("input", { type: "text", list: list.id, autocomplete: "off", maxLength: 80, placeholder: ITEMS[1] });
    this.element = el("form", { className: "fields", noValidate: true },
      ...this.#sides.map(({ rows }) => el("div", { className: "pair" }, ...rows)),
      labelled("Test item", this.#item), list, el("button", { type: "submit", className: "primary" }, "Start the trial"));
    this.element.addEventListener("submit", (event) => {
      event.preventDefault();
      start(this.#body());
    });
  }

  /** Offer the devices; what is chosen stays. Nothing is offered while fewer than two are free. */
  show(devices, busy) {
    const shown = JSON.stringify(devices.map(({ id, name }) => [id, name]));
    this.element.hidden = devices.filter(({ id }) => !busy.has(id)).length < 2;
    if (shown === this.#shown) return;
    this.#shown = shown;
    this.#sides.forEach(({ device }, i) => {
      const before = device.value;
      device.replaceChildren(...devices.map(({ id, name }) => el("option", { value: id }, [name, id].filter(Boolean).join(" · "))));
      const stays = devices.some(({ id }) => id === before);
      device.value = stays ? before : devices[Math.min(i, devices.length - 1)]?.id ?? "";
    });
  }

  #body() {
    const wrists = Object.fromEntries(this.#sides.map(({ device, wrist }) => [device.value, wrist.value]));
    const name = this.#item.value.trim();
    return { devices: this.#sides.map(({ device }) => device.value), wrists, ...(name ? { name } : {}) };
  }
}

/** A trial that is walked: both counts beside each other, and the field for the true one. */
class RunningTrial {
  element;
  #title = el("h3");
  #state = el("p", { className: "hint", role: "status" });
  #sides = el("div", { className: "versus" });
  #truth;
  #form;

  constructor({ finish, cancel }) {
    this.#truth = el("input", {
      type: "text", inputMode: "numeric", autocomplete: "off", className: "short", placeholder: "counted",
    });
    this.#form = el("form", { className: "fields", noValidate: true }, labelled("True steps (may come later)", this.#truth),
      el("button", { type: "submit", className: "primary" }, "Finish"),
      el("button", { type: "button", onclick: cancel }, "Cancel the trial"));
    this.#form.addEventListener("submit", (event) => {
      event.preventDefault();
      finish(trueSteps(this.#truth.value));
    });
    this.element = el("section", { className: "run", "aria-label": "Running trial" }, this.#title, this.#state, this.#sides, this.#form);
  }

  show(trial, name) {
    setText(this.#title, trial.name || `Trial ${trial.number}`);
    setText(this.#state, standing(trial));
    this.#form.hidden = trial.state !== "walking";
    if (this.#sides.children.length !== trial.rows.length) {
      this.#sides.replaceChildren(...trial.rows.map(() => el("p", {}, el("span"), el("strong"), el("small"))));
    }
    trial.rows.forEach((row, i) => {
      const [who, count, note] = this.#sides.children[i].children;
      setText(who, [name(row.device), row.wrist].filter(Boolean).join(", "));
      setText(count, whole(row.steps_now ?? row.steps));
      setText(note, row.note || "");
    });
  }
}
