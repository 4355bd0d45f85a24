/**
 * The dialog in which a device's counters are chosen, and put to the server.
 *
 * What is asked for is checked by the server alone; its sentence is shown, and the field it names is pointed at.
 */

import { of, request } from "./api.js";
import { CounterChoice } from "./counter_choice.js";
import { el, setText } from "./dom.js";
import { changed, consequence, fault, led, standing, ticked, wanted } from "./lineup.js";

export class CountersDialog {
  #dialog;
  #title;
  #list;
  #effect;
  #error;
  #apply;
  #device = null;
  #before = [];
  #choice = null;
  #rows = new Map();
  #done = () => {};

  /** `dialog` is the page's element, its parts named by `data-f`. */
  constructor(dialog) {
    this.#dialog = dialog;
    const part = (name) => dialog.querySelector(`[data-f=${name}]`);
    [this.#title, this.#list, this.#effect, this.#error] = ["title", "list", "effect", "error"].map(part);
    this.#apply = part("apply");
    for (const close of dialog.querySelectorAll("[data-close]")) close.addEventListener("click", () => dialog.close());
    dialog.querySelector("form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.#put();
    });
    dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
  }

  /** Open for `device`; `done(sentence)` is called once the server has taken a change. */
  async open(device, done) {
    this.#device = device;
    this.#done = done;
    this.#choice = null;
    setText(this.#title, `Counters of ${device.name || device.id}`);
    setText(this.#effect, "");
    this.#refuse(null);
    this.#list.replaceChildren(el("p", { className: "hint" }, "Asking the server…"));
    this.#apply.disabled = true;
    this.#dialog.showModal();
    const [counters, lineup] = await Promise.all([request("api/v1/counters"), request(of(device, "counters"))]);
    if (this.#device !== device || !this.#dialog.open) return;
    const error = counters.error ?? lineup.error;
    if (error) this.#list.replaceChildren();
    if (error) this.#refuse(error);
    else this.#fill(counters.value.items, lineup.value.counters);
  }

  #fill(counters, lineup) {
    this.#before = lineup;
    this.#rows = new Map(counters.map((counter) => [counter.name, this.#row(counter)]));
    this.#list.replaceChildren(...[...this.#rows.values()].map(({ element }) => element));
    this.#apply.disabled = false;
    this.#set(standing(counters, lineup));
  }

  #row(counter) {
    const { name } = counter;
    return new CounterChoice(counter, fault(counter, this.#device), {
      tick: (on) => this.#set(ticked(this.#choice, name, on)),
      lead: () => this.#set(led(this.#choice, name)),
      change: (change) => this.#set(changed(this.#choice, name, change)),
    });
  }

  #set(choice) {
    this.#choice = choice;
    for (const entry of choice.entries) this.#rows.get(entry.name).show(entry, choice.primary);
    this.#refuse(null);
    setText(this.#effect, consequence(this.#before, wanted(choice), this.#device.steps));
  }

  async #put() {
    if (!this.#choice || this.#apply.disabled) return;
    this.#apply.disabled = true;
    const asked = this.#device;
    const { error } = await request(of(asked, "counters"), { method: "PUT", body: { counters: wanted(this.#choice) } });
    this.#apply.disabled = false;
    if (this.#device !== asked) return;
    if (error === null) {
      this.#dialog.close();
      this.#done("The counters were changed.");
      return;
    }
    this.#refuse(error);
    for (const row of this.#rows.values()) if (row.blame(error)) break;
  }

  #refuse(sentence) {
    this.#error.hidden = sentence === null;
    setText(this.#error, sentence ?? "");
    if (sentence === null) for (const row of this.#rows.values()) row.blame("");
  }
}
