/**
 * The form that begins a trial: which two devices, on which wrists, and what is tested.
 */

import { el, freshId, labelled } from "./dom.js";
import { wristOf } from "./trial_words.js";

/** Test items to choose from; any other may be typed. */
const ITEMS = ["slow walk", "normal walk", "fast walk", "run", "upstairs", "downstairs"];
const WRISTS = ["left", "right"];

export class TrialForm {
  element;
  #sides;
  #item;
  #devices = [];
  #shown = "";

  /** `start(body)` is called with what to ask the server for. */
  constructor(start) {
    const list = el("datalist", { id: freshId("items") }, ...ITEMS.map((value) => el("option", { value })));
    this.#sides = ["First", "Second"].map((which, i) => {
      const device = el("select", { onchange: () => this.#guess(i) });
      const wrist = el("select", {}, ...WRISTS.map((side) => el("option", { value: side }, side)));
      wrist.value = WRISTS[i];
      return { device, wrist, rows: [labelled(`${which} bracelet`, device), labelled("Wrist", wrist)] };
    });
    this.#item = el("input", { type: "text", list: list.id, autocomplete: "off", maxLength: 80 });
    this.#item.placeholder = ITEMS[1];
    this.element = el("form", { className: "fields", noValidate: true },
      ...this.#sides.map(({ rows }) => el("div", { className: "pair" }, ...rows)),
      labelled("Test item", this.#item), list,
      el("button", { type: "submit", className: "primary" }, "Start the trial"));
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
    this.#devices = devices;
    this.#sides.forEach(({ device }, i) => {
      const before = device.value;
      const options = devices.map(({ id, name }) => el("option", { value: id }, name ? `${name} · ${id}` : id));
      device.replaceChildren(...options);
      const stays = devices.some(({ id }) => id === before);
      device.value = stays ? before : devices[Math.min(i, devices.length - 1)]?.id ?? "";
      if (!stays) this.#guess(i);
    });
  }

  /** Choose the wrist that the device's name tells of. */
  #guess(i) {
    const { device, wrist } = this.#sides[i];
    const known = this.#devices.find(({ id }) => id === device.value);
    wrist.value = (known && wristOf(known)) ?? wrist.value;
  }

  #body() {
    const wrists = Object.fromEntries(this.#sides.map(({ device, wrist }) => [device.value, wrist.value]));
    const name = this.#item.value.trim();
    return { devices: this.#sides.map(({ device }) => device.value), wrists, ...(name ? { name } : {}) };
  }
}
