/**
 * One lane below the plot for each counter on a device's stream: its name, its own count, a mark at each of its steps.
 *
 * Lanes lie on the plot's time axis, so marks of several counters stand side by side. A counter that cannot count on
 * this device says why instead.
 */

import { fit, theme, timeAxis } from "./axis.js";
import { el, setText } from "./dom.js";
import { whole } from "./format.js";
import { COLOURS, look, outline, paintCounted, paintLikely, words } from "./looks.js";
import { presence } from "./trace.js";

const RADIUS = 5;
const SVG = "http://www.w3.org/2000/svg";

export class Lanes {
  #list;
  #trace;
  #lanes = new Map();
  #primary = null;
  #colours = {};

  constructor(list, trace) {
    this.#list = list;
    this.#trace = trace;
  }

  /** Show a lane for each counter of `device`, the primary's first. */
  show({ primary, counters, counter_faults: faults = {} }) {
    const names = [primary, ...Object.keys(counters).filter((name) => name !== primary)];
    if (names.join() !== [...this.#lanes.keys()].join()) this.#arrange(names);
    this.#primary = primary;
    for (const [name, lane] of this.#lanes) lane.show(counters[name] ?? 0, faults[name], name === primary);
  }

  /** How many lanes there are. */
  get count() {
    return this.#lanes.size;
  }

  restyle() {
    this.#colours = theme(this.#list, [...COLOURS, "grid", "card"]);
  }

  /** Draw what stands at the device time `edge` (null before the first sample). */
  draw(edge, nowMs, { motion = true } = {}) {
    for (const [name, lane] of this.#lanes) {
      const steps = this.#trace.steps.filter(({ counter }) => counter === name);
      const likely = name === this.#primary ? this.#trace.likely : [];
      lane.draw({ edge, nowMs, motion, steps, likely, colours: this.#colours });
    }
  }

  #arrange(names) {
    this.#lanes = new Map(names.map((name) => [name, this.#lanes.get(name) ?? new Lane(name)]));
    this.#list.replaceChildren(...[...this.#lanes.values()].map(({ element }) => element));
  }
}

/** Return a counter's mark as a small picture. */
export function glyph(counter) {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", "-1.5 -1.5 3 3");
  svg.setAttribute("class", "glyph");
  svg.setAttribute("aria-hidden", "true");
  const path = document.createElementNS(SVG, "path");
  path.setAttribute("d", look(counter).path);
  svg.append(path);
  svg.style.setProperty("--look", `var(--${look(counter).colour})`);
  return svg;
}

class Lane {
  element;
  #name;
  #count = el("b");
  #tag = el("small", { className: "tag" }, "primary");
  #fault = el("p", { className: "lane-fault", hidden: true });
  #canvas = el("canvas", { "aria-hidden": "true" });
  #context;

  constructor(name) {
    this.#name = name;
    this.#context = this.#canvas.getContext("2d");
    const label = el("p", { className: "lane-name" }, glyph(name), el("span", {}, words(name)), this.#tag, this.#count);
    this.element = el("li", { className: "lane", "data-counter": name }, label, this.#canvas, this.#fault);
  }

  show(steps, fault, primary) {
    setText(this.#count, fault ? "" : whole(steps));
    this.#tag.hidden = !primary;
    this.#canvas.hidden = Boolean(fault);
    this.#fault.hidden = !fault;
    setText(this.#fault, fault ?? "");
  }

  draw({ edge, nowMs, motion, steps, likely, colours }) {
    if (this.#canvas.hidden) return;
    const c = this.#context;
    const { width, height } = fit(this.#canvas, c);
    if (!width || !height) return;
    const { fromS, right, x } = timeAxis(edge, width);
    const y = height / 2;
    c.clearRect(0, 0, width, height);
    c.fillStyle = colours.grid;
    c.fillRect(x(fromS), Math.round(y) - 0.5, right - x(fromS), 1);
    if (edge === null) return;
    const paint = { colour: colours[look(this.#name).colour], ground: colours.card };
    const shown = ({ atS }) => atS >= fromS && atS <= edge;
    for (const one of [...likely, ...steps].filter(shown)) {
      const shape = outline(this.#name, x(one.atS), y, RADIUS);
      const alpha = presence(one, nowMs, motion);
      if (likely.includes(one)) paintLikely(c, shape, { ...paint, alpha });
      else if (one.wasLikely && alpha < 1) paintLikely(c, shape, paint);
      if (!likely.includes(one)) paintCounted(c, shape, { ...paint, alpha });
    }
  }
}
