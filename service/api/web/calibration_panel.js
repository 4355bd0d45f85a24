/**
 * Calibrations in a device's card: begin one, watch it, end it early or cancel it, let a counter use it.
 *
 * The panel asks the server once a second while something is recorded, else every five seconds, and only while it is
 * open. What is chosen stays where it is when an answer comes.
 */

import { NO_ANSWER, of, request } from "./api.js";
import { CalibrationForm } from "./calibration_form.js";
import { ended, method, offers, outcome, progress, title } from "./calibration_words.js";
import { button, el, setText } from "./dom.js";
import { capital } from "./format.js";
import { words } from "./looks.js";
import { Poll } from "./poll.js";

const WATCH_MS = 1_000;
const REST_MS = 5_000;

export class CalibrationPanel {
  element;
  #form;
  #none = el("p", { className: "hint", hidden: true }, "No counter can be calibrated on this bracelet.");
  #asking = el("p", { className: "hint" }, "Asking what can be calibrated…");
  #error = el("p", { className: "notice bad", role: "alert", hidden: true });
  #said = el("p", { className: "notice good", role: "status", hidden: true });
  #recording;
  #list = el("div", { className: "outcomes" });
  #poll;
  #device = null;
  #counters = null;
  #shown = "";
  #chosen = new Set();
  #unchosen = new Set();
  #cut = false;

  constructor() {
    this.#form = new CalibrationForm((body) => this.#begin(body));
    this.#form.element.hidden = true; // until there is something to choose: what is typed before that would be lost
    this.#recording = new Recording({
      finish: (number) => this.#finish(number),
      cancel: (number) => this.#forget(number),
    });
    this.element = el("section", { className: "panel", hidden: true, "aria-label": "Calibrations" },
      this.#asking, this.#none, this.#form.element, this.#recording.element, this.#error, this.#said, this.#list);
    this.#poll = new Poll(() => this.#ask());
  }

  /** Take the device as it stands now. */
  show(device) {
    this.#device = device;
  }

  /** Show or hide the panel. */
  toggle(open) {
    this.element.hidden = !open;
    if (open) this.#poll.now();
    else this.#poll.stop();
  }

  async #ask() {
    this.#counters ??= (await request("api/v1/counters")).value?.items ?? null;
    const { value, error } = await request(of(this.#device, "calibrations"));
    if (error || !this.#counters) return this.#unreached(error ?? NO_ANSWER);
    if (this.#cut) this.#error.hidden = true;
    this.#cut = false;
    const before = this.#recording.number;
    this.#fill(value.items);
    const hasEnded = before !== null && this.#recording.number === null;
    if (hasEnded) this.#tell(value.items.find(({ number }) => number === before));
    return this.#recording.number === null ? REST_MS : WATCH_MS;
  }

  /** Say how the recording that has just ended came out. */
  #tell(one) {
    if (!one) return;
    setText(this.#said, `${title(one)}: ${one.state === "failed" ? "failed, see below." : "done."}`);
    this.#said.hidden = one.state === "failed";
  }

  /** Say that the server could not be asked; the sentence goes with the next answer. */
  #unreached(error) {
    this.#fail(error);
    this.#cut = true;
    return REST_MS;
  }

  #fail(error) {
    this.#asking.hidden = true;
    setText(this.#error, error);
    this.#error.hidden = false;
    this.#cut = false;
  }

  #fill(calibrations) {
    const able = offers(this.#counters, this.#device);
    const recording = calibrations.find(({ state }) => state === "recording");
    this.#asking.hidden = true;
    this.#none.hidden = able.length > 0;
    this.#form.offer(able);
    this.#form.element.hidden = Boolean(recording) || able.length === 0;
    this.#recording.show(recording ?? null);
    for (const { number, state } of calibrations) {
      if (state === "done" && !this.#unchosen.has(number)) this.#chosen.add(number);
    }
    const past = ended(calibrations);
    const shown = JSON.stringify(past);
    if (shown === this.#shown) return;
    this.#shown = shown;
    this.#list.replaceChildren(...past.map((group) => this.#group(group)));
  }

  #group({ counter, method: kind, items }) {
    const done = items.filter(({ state }) => state === "done");
    const apply = button(`Apply to ${words(counter)}`, () => this.#apply(done), { className: "primary" });
    const head = `${words(counter)}: ${method(kind).title.toLowerCase()}`;
    return el("section", { "aria-label": head }, el("h3", {}, head),
      el("ul", { className: "plain" }, ...items.map((one) => this.#item(one))),
      done.length ? apply : null);
  }

  #item(one) {
    const name = `Forget ${title(one)}, number ${one.number}`;
    const forget = button("Forget", () => this.#forget(one.number), { className: "quiet", "aria-label": name });
    const head = el("b", {}, one.pace ?? `Number ${one.number}`);
    const text = el("span", { className: "said" }, head, el("span", {}, outcome(one)));
    if (one.state !== "done") return el("li", { className: "failed" }, text, forget);
    const tick = el("input", {
      type: "checkbox", checked: this.#chosen.has(one.number), onchange: () => this.#choose(one.number, tick.checked),
    });
    return el("li", {}, el("label", { className: "tick" }, tick, text), forget);
  }

  #choose(number, on) {
    const [to, from] = on ? [this.#chosen, this.#unchosen] : [this.#unchosen, this.#chosen];
    to.add(number);
    from.delete(number);
  }

  async #begin(body) {
    this.#form.blame(await this.#change("POST", ["calibrations"], body));
  }

  #finish(number) {
    return this.#change("POST", ["calibrations", number, "finish"]);
  }

  #forget(number) {
    this.#chosen.delete(number);
    return this.#change("DELETE", ["calibrations", number]);
  }

  async #apply(done) {
    const numbers = done.map(({ number }) => number).filter((number) => this.#chosen.has(number));
    if (numbers.length === 0) {
      this.#fail("Tick what is to be applied.");
      return;
    }
    const name = capital(words(done[0].counter));
    if (await this.#change("POST", ["calibrations", "apply"], { numbers }) === null) {
      const leads = this.#device.primary === done[0].counter;
      const segment = leads ? " A new segment begins; the count goes on." : "";
      setText(this.#said, `${name} now uses what was learnt.${segment}`);
      this.#said.hidden = false;
    }
  }

  /** Ask for a change; resolves to the sentence of a refusal, null where there was none. */
  async #change(verb, parts, body) {
    this.#error.hidden = true;
    this.#said.hidden = true;
    const { error } = await request(of(this.#device, ...parts), { method: verb, body });
    if (error) this.#fail(error);
    this.#poll.now();
    return error;
  }
}

/** The calibration that is being recorded: how far it is, and how to end it. */
class Recording {
  element;
  number = null;
  #title = el("b");
  #text = el("span");
  #bar = el("progress", { max: 1, value: 0, "aria-label": "Progress of the calibration" });

  constructor({ finish, cancel }) {
    this.element = el("section", { className: "recording", hidden: true, "aria-label": "Calibration that is recorded" },
      el("p", { className: "told" }, this.#title, this.#text), this.#bar,
      el("div", { className: "tools" },
        button("Finish early", () => finish(this.number)), button("Cancel", () => cancel(this.number))));
  }

  show(one) {
    this.number = one?.number ?? null;
    this.element.hidden = one === null;
    if (one === null) return;
    const { share, text } = progress(one);
    setText(this.#title, `${title(one)}: walk now`);
    setText(this.#text, text);
    this.#bar.value = share;
  }
}
