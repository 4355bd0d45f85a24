/**
 * A trial that is walked: both counts live beside each other, and the field for the true one.
 */

import { button, el, labelled, mark, numberField, setText } from "./dom.js";
import { whole } from "./format.js";
import { REFUSED, standing, trueSteps } from "./trial_words.js";

export class TrialRun {
  element;
  #title = el("h3");
  #state = el("p", { className: "hint", role: "status" });
  #sides = el("div", { className: "versus" });
  #truth;
  #form;

  /** `finish(steps)` gets the true steps, or null where they are not known yet; resolves to `{status}`. */
  constructor({ finish, cancel }) {
    this.#truth = numberField({ placeholder: "counted", oninput: () => mark(this.#truth, false) });
    this.#form = el("form", { className: "fields", noValidate: true },
      labelled("True steps (may come later)", this.#truth),
      el("button", { type: "submit", className: "primary" }, "Finish"), button("Cancel the trial", () => cancel()));
    this.#form.addEventListener("submit", async (event) => {
      event.preventDefault();
      const steps = trueSteps(this.#truth.value);
      const { status } = await finish(steps);
      mark(this.#truth, status === REFUSED && steps !== null);
    });
    this.element = el("section", { className: "run", "aria-label": "Running trial" },
      this.#title, this.#state, this.#sides, this.#form);
  }

  /** Show the trial as it stands; `name(id)` says what a device is called. */
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
