/**
 * The table of finished trials, in the columns of Wang 2018's Table 4, with means, true steps to enter, and deleting.
 */

import { button, el, mark, numberField, setText } from "./dom.js";
import { plural } from "./format.js";
import { COLUMNS, REFUSED, cells, means, trueSteps } from "./trial_words.js";

/** How long a first press of Delete waits for the second. */
const SURE_MS = 4_000;

export class TrialTable {
  element;
  #table;
  #means = el("ul", { className: "plain means" });
  #tell;
  #shown = "";
  /** What was typed as true steps and not taken, by trial: `{text, wrong}`. */
  #typed = new Map();

  /** `tell` has `truth(number, steps)`, which resolves to `{status, error}`, and `remove(number)`. */
  constructor(tell) {
    this.#tell = tell;
    const heads = COLUMNS.map(({ title, number }) => (
      el("th", { role: "columnheader", scope: "col", className: number ? "number" : "" }, title)));
    heads.push(el("th", { role: "columnheader", scope: "col" }, el("span", { className: "unseen" }, "Delete")));
    // Roles are said in full: on a narrow screen the style sheet lays rows out as blocks, which would lose them.
    this.#table = el("table", { role: "table" },
      el("caption", {}, "Finished trials"), el("thead", {}, el("tr", {}, ...heads)));
    const csv = el("a", { href: "api/v1/trials/table.csv", download: "trials.csv" }, "Download as CSV");
    csv.className = "button";
    this.element = el("section", { className: "finished", hidden: true, "aria-label": "Finished trials" },
      el("div", { className: "sideways", tabIndex: 0, role: "region", "aria-label": "Table of trials" }, this.#table),
      el("h3", {}, "Mean accuracy"), this.#means, csv);
  }

  /** Show the done ones of `trials`; a field that is being filled in stays as it is. */
  show(trials, name) {
    this.element.hidden = trials.length === 0;
    const shown = JSON.stringify([trials, trials.flatMap(({ rows }) => rows.map(({ device }) => name(device)))]);
    if (shown === this.#shown || this.#isEdited) return;
    this.#shown = shown;
    const held = this.#table.contains(document.activeElement) && document.activeElement.getAttribute("aria-label");
    for (const body of [...this.#table.tBodies]) body.remove();
    this.#table.append(...trials.map((trial) => el("tbody", { role: "rowgroup" }, ...this.#rows(trial, name))));
    if (held) this.#table.querySelector(`[aria-label="${CSS.escape(held)}"]`)?.focus();
    const mean = means(trials, name);
    this.#means.replaceChildren(...mean.map(({ title, text, rows: count }) => (
      el("li", {}, el("span", {}, title), el("b", {}, text), el("small", {}, plural(count, "row"))))));
    if (mean.length === 0) this.#means.append(el("li", { className: "hint" }, "Enter the true steps to see it."));
  }

  get #isEdited() {
    const active = document.activeElement;
    return this.#table.contains(active) && active.matches("input") && active.value !== active.defaultValue;
  }

  /** The rows of one trial; on a narrow screen they stand side by side, a note under its own. */
  #rows(trial, name) {
    return cells(trial, name).flatMap((row, i) => {
      const own = COLUMNS.map((column) => this.#cell(trial, row, column, i === 0));
      const remove = el("td", { role: "cell", className: "last" }, i === 0 ? this.#remove(trial, row.item) : null);
      const side = i % 2 ? "right" : "left";
      const doubt = el("tr", { role: "row", className: `doubt ${side}` }, el("td", { role: "cell", colspan: "9" }, row.note));
      const line = el("tr", { role: "row", className: i === 0 ? `first ${side}` : side }, ...own, remove);
      return row.note ? [line, doubt] : [line];
    });
  }

  /** The true steps belong to the trial: its first row has the field, the others repeat them. */
  #cell(trial, row, { key, title, number }, first) {
    const value = key === "truth" && first ? this.#truth(trial, row) : row[key];
    return el("td", { role: "cell", className: number ? "number" : "", "data-title": title, "data-key": key }, value);
  }

  #truth(trial, { item }) {
    const before = trial.true_steps == null ? "" : String(trial.true_steps);
    const field = numberField({
      defaultValue: before, placeholder: "?",
      "aria-label": `True steps of ${item}`,
      onchange: () => this.#enter(trial.number, field),
      oninput: () => mark(field, false),
      onkeydown: (event) => event.key === "Enter" && field.blur(),
    });
    const { text = before, wrong = false } = this.#typed.get(trial.number) ?? {};
    field.value = text;
    mark(field, wrong);
    return field;
  }

  /** What the server does not take stays as it was typed, marked where it is wrong. */
  async #enter(number, field) {
    const text = field.value;
    const steps = trueSteps(text);
    this.#typed.delete(number);
    if (steps === null) return;
    this.#typed.set(number, { text, wrong: false });
    const { status, error } = await this.#tell.truth(number, steps);
    if (this.#typed.get(number)?.text !== text) return;
    if (error === null) this.#typed.delete(number);
    else this.#typed.set(number, { text, wrong: status === REFUSED });
    mark(field, status === REFUSED);
  }

  /** Deleting takes two presses; the button says so in between. */
  #remove({ number }, item) {
    let sure = false;
    const say = (text, name) => {
      setText(remove, text);
      remove.setAttribute("aria-label", name);
    };
    const unsure = () => {
      sure = false;
      say("Delete", `Delete ${item}`);
    };
    const press = () => {
      if (sure) return this.#tell.remove(number);
      sure = true;
      say("Sure?", `Press again to delete ${item}`);
      return setTimeout(unsure, SURE_MS);
    };
    const remove = button("Delete", press, { className: "quiet", "aria-label": `Delete ${item}` });
    return remove;
  }
}
