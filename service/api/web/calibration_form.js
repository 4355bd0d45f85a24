/**
 * The form that begins a calibration: which one, at which pace, for how many steps or how long.
 */

import { LIMITS, PACES, asked, blamesAmount, method, range } from "./calibration_words.js";
import { el, freshId, labelled, mark, numberField, setText } from "./dom.js";
import { words } from "./looks.js";

export class CalibrationForm {
  element;
  #offers = [];
  #which;
  #text = el("p", { className: "hint" });
  #paceRow;
  #pace = el("select", {}, ...PACES.map((pace) => el("option", { value: pace }, pace)));
  #limit;
  #amount;
  #range = el("small", { id: freshId("range") });
  #start = el("button", { type: "submit", className: "primary" }, "Start");

  /** `start(body)` is called with what to ask the server for. */
  constructor(start) {
    this.#pace.value = "normal";
    this.#which = el("select", { onchange: () => this.#follow() });
    this.#limit = el("select", { onchange: () => this.#usual() });
    this.#amount = numberField({ "aria-describedby": this.#range.id, oninput: () => mark(this.#amount, false) });
    this.#paceRow = labelled("Pace", this.#pace);
    this.element = el("form", { className: "fields", noValidate: true }, this.#text,
      labelled("Calibration", this.#which), this.#paceRow,
      labelled("For", el("span", { className: "valued" }, this.#amount, this.#limit)), this.#start,
      this.#range);
    this.#amount.setAttribute("aria-label", "How many");
    this.#limit.setAttribute("aria-label", "Steps or seconds");
    this.element.addEventListener("submit", (event) => {
      event.preventDefault();
      if (this.#offer) start(asked(this.#offer, this.#values()));
    });
  }

  /** Show what can be offered; the choice that stands stays where it still can be. */
  offer(offers) {
    const key = JSON.stringify(offers);
    if (key === JSON.stringify(this.#offers)) return;
    const before = this.#which.value;
    this.#offers = offers;
    this.#which.replaceChildren(...grouped(offers));
    if (before && offers[Number(before)]) this.#which.value = before;
    this.#follow();
  }

  /** Point at the field that a refusal names; null says that nothing was refused. What was typed stays. */
  blame(sentence) {
    const wrong = sentence !== null && blamesAmount(sentence);
    mark(this.#amount, wrong);
    if (wrong) this.#amount.focus();
  }

  get #offer() {
    return this.#offers[Number(this.#which.value)];
  }

  #values() {
    return { limit: this.#limit.value, amount: this.#amount.value, pace: this.#pace.value };
  }

  #follow() {
    if (!this.#offer) return;
    const { text, limits, paced } = method(this.#offer.method);
    setText(this.#text, `For ${words(this.#offer.counter)}. ${text}`.trim());
    this.#paceRow.hidden = !paced;
    const before = this.#limit.value;
    this.#limit.replaceChildren(...limits.map((limit) => el("option", { value: limit }, LIMITS[limit].noun)));
    if (limits.includes(before)) this.#limit.value = before;
    if (this.#limit.value !== before) this.#usual();
    setText(this.#range, range(this.#offer.method, this.#limit.value));
  }

  #usual() {
    this.#amount.value = String(LIMITS[this.#limit.value].usual);
    mark(this.#amount, false);
    setText(this.#range, range(this.#offer.method, this.#limit.value));
  }
}

/** The offers as options, those of a counter together. */
function grouped(offers) {
  const counters = [...new Set(offers.map(({ counter }) => counter))];
  return counters.map((counter) => el("optgroup", { label: words(counter) },
    ...offers.flatMap((offer, i) => (offer.counter === counter
      ? [el("option", { value: String(i) }, method(offer.method).title)] : []))));
}
