/**
 * One counter in the dialog that chooses them: whether it runs, whether it leads, its preset and its parameters.
 */

import { el, freshId, mark, setText } from "./dom.js";
import { glyph } from "./lanes.js";
import { named, typed, valueOf } from "./lineup.js";
import { words } from "./looks.js";

/** The sensor that every wearable has: it is not worth a word. */
const USUAL = "accelerometer";

export class CounterChoice {
  element;
  #counter;
  #tell;
  #tick;
  #lead;
  #preset;
  #more;
  #summary = el("summary");
  #fields;
  #entry = null;

  /** `tell` has `tick(on)`, `lead()` and `change({preset, params})`; `fault` says why it does not count here. */
  constructor(counter, fault, tell) {
    this.#counter = counter;
    this.#tell = tell;
    const name = words(counter.name);
    this.#tick = el("input", { type: "checkbox", onchange: () => tell.tick(this.#tick.checked) });
    this.#lead = el("input", { type: "radio", name: "primary", onchange: () => tell.lead() });
    this.#preset = el("select", { onchange: () => tell.change({ preset: this.#preset.value, params: {} }) },
      ...["tuned", "paper"].map((preset) => el("option", { value: preset }, preset)));
    this.#fields = counter.parameters.map((parameter) => new Field(parameter, (text) => this.#type(parameter, text)));
    this.#more = el("details", { className: "params" }, this.#summary,
      el("div", { className: "param-grid" }, ...this.#fields.map(({ element }) => element)));
    const needs = counter.sensors.some((sensor) => sensor !== USUAL) ? `Needs ${counter.sensors.join(", ")}` : null;
    this.element = el("section", { className: "choice", "data-counter": counter.name, "aria-label": name },
      el("div", { className: "choice-head" },
        el("label", { className: "tick" }, this.#tick, glyph(counter.name), el("span", {}, name)),
        el("label", { className: "tick" }, this.#lead, el("span", {}, "primary"),
          el("span", { className: "unseen" }, `: ${name}`)),
        el("label", { className: "inline" }, el("span", {}, "Preset"), this.#preset)),
      fault || needs ? el("p", { className: fault ? "hint bad" : "hint" }, fault ?? needs) : null,
      this.#more);
  }

  /** Show an entry of the choice; `primary` names the leading counter. */
  show(entry, primary) {
    this.#entry = entry;
    this.#tick.checked = entry.on;
    this.#lead.checked = entry.name === primary;
    this.#preset.value = entry.preset;
    this.element.classList.toggle("on", entry.on);
    const count = Object.keys(entry.params).length;
    setText(this.#summary, `Parameters (${this.#fields.length})${count ? `, ${count} changed` : ""}`);
    for (const field of this.#fields) field.show(entry);
  }

  /** Point at the parameter that a refusal names, as "autocorrelation.bout = 99: …"; return whether it is this counter's. */
  blame(sentence) {
    const { name } = this.#counter;
    const guilty = this.#fields.find((field) => this.#entry.on && named(sentence, name, field.name, this.#entry));
    for (const field of this.#fields) field.mark(field === guilty);
    if (!guilty) return false;
    this.#more.open = true;
    guilty.focus();
    return true;
  }

  #type(parameter, text) {
    this.#tell.change({ params: typed(parameter, this.#entry, text) });
  }
}

/** One parameter: its field, its unit, its range and what the presets say. */
class Field {
  element;
  #parameter;
  #input;
  #hint;
  #text = "";

  constructor(parameter, onTyped) {
    this.#parameter = parameter;
    const [id, hintId] = [freshId("parameter"), freshId("hint")];
    const { options, low, high, unit, presets } = parameter;
    const common = {
      id, "aria-describedby": hintId, oninput: () => onTyped(this.#input.value), onblur: () => this.#write(),
    };
    this.#input = options
      ? el("select", common, ...options.map((word) => el("option", { value: word }, word)))
      : el("input", { ...common, type: "text", inputMode: "decimal", autocomplete: "off" });
    const range = options ? "" : `${low} to ${high} ${unit}, `;
    this.#hint = el("small", { id: hintId }, `${range}paper ${presets.paper}, tuned ${presets.tuned}`);
    this.element = el("div", { className: "param" },
      el("label", { for: id }, parameter.text, " ", el("code", {}, parameter.name)),
      el("span", { className: "valued" }, this.#input, options ? null : el("span", { className: "unit" }, unit)),
      this.#hint);
  }

  /** Show the entry's value; what is just being typed stays as it is typed. */
  show(entry) {
    this.#text = valueOf(this.#parameter, entry);
    if (document.activeElement !== this.#input) this.#write();
    this.element.classList.toggle("changed", this.#parameter.name in entry.params);
  }

  #write() {
    if (this.#input.value !== this.#text) this.#input.value = this.#text;
  }

  get name() {
    return this.#parameter.name;
  }

  mark(wrong) {
    mark(this.#input, wrong);
  }

  focus() {
    this.#input.focus();
  }
}
