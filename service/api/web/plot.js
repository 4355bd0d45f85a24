/**
 * Draws one trace on a canvas: the filtered magnitude, both thresholds and a mark at each counted step.
 *
 * The last DECIDING_S before the right edge are drawn faint: a counter decides there still. Left of them thresholds and
 * marks are final and lie on the signal; a mark that is decided earlier pops up within the faint part.
 */

import { PAD, WINDOW_S, fit, theme, ticks, timeAxis } from "./axis.js";
import { COLOURS, look, outline, paintCounted, paintLikely } from "./looks.js";
import { presence } from "./trace.js";

/** Display delay of what is decided: one threshold window and the next two valleys of a slow walk. */
export const DECIDING_S = 2.5;
/** A hole this long in the signal is a gap; a shorter one is a message that was merged away. */
const HOLE_S = 0.12;
/** A hole that reaches the right edge may still be filled by what is on its way. */
const OPEN_HOLE_S = 1;
/** Smallest height of the picture in g, so that rest looks like rest. */
const LEAST_SPAN_G = 0.6;
const RANGE_PER_S = 3;

/** Return [from, to] of each stretch of [fromS, toS] without samples: HOLE_S long, OPEN_HOLE_S where it goes on. */
export function holes(trace, fromS, toS) {
  const found = [];
  const last = Math.floor(toS * trace.rateHz);
  let since = null;
  for (let k = Math.ceil(fromS * trace.rateHz); k <= last + 1; k += 1) {
    const missing = k <= last && Number.isNaN(trace.at(k));
    if (missing) since ??= k;
    if (missing || since === null) continue;
    const hole = [(since - 1) / trace.rateHz, k / trace.rateHz];
    if (hole[1] - hole[0] >= (k > last ? OPEN_HOLE_S : HOLE_S)) found.push(hole);
    since = null;
  }
  return found;
}

export class Plot {
  #canvas;
  #context;
  #trace;
  #colours = {};
  #range = null;
  #drawnMs = 0;

  constructor(canvas, trace) {
    this.#canvas = canvas;
    this.#context = canvas.getContext("2d");
    this.#trace = trace;
    this.restyle();
  }

  /** Read the colours of the theme again. */
  restyle() {
    this.#colours = theme(this.#canvas, ["signal", "upper", "lower", "grid", "ink-soft", "card", "gap", ...COLOURS]);
  }

  /**
   * Draw the picture of `nowMs`; without `motion` marks appear without an animation. `idle` says that no signal is to
   * be expected: the time axis stands alone.
   */
  draw(nowMs, { motion = true, idle = false } = {}) {
    const { width, height } = fit(this.#canvas, this.#context);
    if (!width || !height) return;
    const edge = idle ? null : this.#trace.edge(nowMs);
    const frame = this.#frame(edge, width, height, nowMs);
    this.#context.clearRect(0, 0, width, height);
    if (!idle) this.#scale(frame);
    this.#times(frame);
    if (edge === null) {
      if (!idle) this.#waiting(frame);
      return;
    }
    this.#context.save();
    this.#context.beginPath();
    this.#context.rect(PAD.left, 0, frame.right - PAD.left, height);
    this.#context.clip();
    this.#thresholds(frame);
    this.#signal(frame);
    this.#deciding(frame);
    this.#gaps(frame);
    this.#marks(frame, nowMs, motion);
    this.#context.restore();
  }

  /** Return the mapping of device time and g to the canvas; the range of g glides. */
  #frame(edge, width, height, nowMs) {
    const bottom = height - PAD.bottom;
    const { fromS, right, x } = timeAxis(edge, width);
    const [low, high] = this.#glide(this.#extent(fromS, edge), nowMs);
    const y = (g) => bottom - ((g - low) / (high - low)) * (bottom - PAD.top);
    return { edge, fromS, right, bottom, low, high, x, y };
  }

  #extent(fromS, edge) {
    let [low, high] = [Infinity, -Infinity];
    const see = (g) => {
      if (g < low) low = g;
      if (g > high) high = g;
    };
    if (edge !== null) {
      const { rateHz } = this.#trace;
      for (let k = Math.ceil(fromS * rateHz); k <= edge * rateHz; k += 1) see(this.#trace.at(k));
      for (const { to_s, upper, lower } of this.#trace.bands) if (to_s > fromS) [upper, lower].forEach(see);
    }
    if (low > high) [low, high] = [1, 1];
    const [middle, span] = [(low + high) / 2, Math.max(LEAST_SPAN_G, (high - low) * 1.2)];
    return [middle - span / 2, middle + span / 2];
  }

  #glide(wanted, nowMs) {
    const share = this.#range ? 1 - Math.exp((-RANGE_PER_S * (nowMs - this.#drawnMs)) / 1000) : 1;
    this.#drawnMs = nowMs;
    this.#range = wanted.map((g, i) => g + ((this.#range ?? wanted)[i] - g) * (1 - share));
    return this.#range;
  }

  #scale({ right, low, high, y }) {
    const c = this.#context;
    c.font = this.#colours.font;
    c.fillStyle = this.#colours["ink-soft"];
    c.strokeStyle = this.#colours.grid;
    c.lineWidth = 1;
    c.textBaseline = "middle";
    c.textAlign = "right";
    const marks = ticks(low, high);
    const digits = marks.length > 1 && marks[1] - marks[0] < 1 ? 1 : 0;
    for (const g of marks) {
      const at = Math.round(y(g)) + 0.5;
      this.#line(PAD.left, at, right, at);
      c.fillText(g.toFixed(digits), PAD.left - 8, at);
    }
  }

  #times({ right, bottom }) {
    const c = this.#context;
    c.font = this.#colours.font;
    c.fillStyle = this.#colours["ink-soft"];
    c.strokeStyle = this.#colours.grid;
    c.lineWidth = 1;
    c.textBaseline = "alphabetic";
    for (let s = WINDOW_S; s >= 0; s -= 2) {
      const at = right - (s / WINDOW_S) * (right - PAD.left);
      this.#line(at, bottom, at, bottom + 4);
      c.textAlign = s === 0 ? "right" : "center";
      c.fillText(s === 0 ? "now" : `−${s} s`, s === 0 ? right + 8 : at, bottom + 18);
    }
    this.#line(PAD.left, bottom, right, bottom);
  }

  #waiting({ right, bottom }) {
    const c = this.#context;
    c.textAlign = "center";
    c.fillText("The signal appears here", (PAD.left + right) / 2, (PAD.top + bottom) / 2 - 8);
  }

  #gaps({ edge, fromS, right, bottom, x }) {
    const c = this.#context;
    const known = this.#trace.gaps.map(({ fromS: from, toS: to }) => [from, to]);
    c.strokeStyle = this.#colours.gap;
    c.lineWidth = 1;
    const begun = Math.max(fromS, this.#trace.beginS);
    for (const [from, to] of [...known, ...holes(this.#trace, begun, edge)]) {
      const [left, end] = [Math.max(PAD.left, x(from)), Math.min(right, x(to))];
      if (end > left) this.#hatch(left, end, bottom);
    }
  }

  #hatch(left, end, bottom) {
    const c = this.#context;
    c.save();
    c.beginPath();
    c.rect(left, PAD.top, end - left, bottom - PAD.top);
    c.clip();
    const height = bottom - PAD.top;
    c.beginPath();
    for (let at = left - height - ((left - height) % 9); at < end; at += 9) {
      c.moveTo(at, bottom);
      c.lineTo(at + height, PAD.top);
    }
    c.stroke();
    c.restore();
  }

  #thresholds({ fromS, x, y }) {
    for (const [name, dash] of [["upper", [7, 4]], ["lower", [2, 3]]]) {
      const c = this.#context;
      c.strokeStyle = this.#colours[name];
      c.lineWidth = 1.75;
      c.setLineDash(dash);
      c.beginPath();
      let previous = null;
      for (const band of this.#trace.bands) {
        if (band.to_s < fromS || band[name] == null) continue;
        const joined = previous !== null && Math.abs(previous - band.from_s) < 0.05;
        if (joined) c.lineTo(x(band.from_s), y(band[name]));
        else c.moveTo(x(band.from_s), y(band[name]));
        c.lineTo(x(band.to_s), y(band[name]));
        previous = band.to_s;
      }
      c.stroke();
      c.setLineDash([]);
    }
  }

  #signal({ edge, fromS, x, y }) {
    const c = this.#context;
    const { rateHz } = this.#trace;
    c.strokeStyle = this.#colours.signal;
    c.lineWidth = 2;
    c.lineJoin = "round";
    c.beginPath();
    let drawing = false;
    for (let k = Math.floor(fromS * rateHz); k <= edge * rateHz + 1; k += 1) {
      const g = this.#trace.at(k);
      if (Number.isNaN(g)) drawing = false;
      else if (drawing) c.lineTo(x(k / rateHz), y(g));
      else {
        c.moveTo(x(k / rateHz), y(g));
        drawing = true;
      }
    }
    c.stroke();
  }

  /** Veil what is not decided yet; where no signal comes there is nothing to decide. */
  #deciding({ edge, right, bottom, x }) {
    if (this.#trace.valueAt(edge - OPEN_HOLE_S) === null) return;
    const c = this.#context;
    const left = x(edge - DECIDING_S);
    c.globalAlpha = 0.55;
    c.fillStyle = this.#colours.card;
    c.fillRect(left, PAD.top, right - left, bottom - PAD.top);
    c.globalAlpha = 1;
    c.fillStyle = this.#colours["ink-soft"];
    c.textAlign = "right";
    c.fillText("deciding…", right - 2, PAD.top - 8);
    c.strokeStyle = this.#colours.grid;
    c.lineWidth = 1;
    this.#line(left, PAD.top, left, bottom);
  }

  /** Mark the primary's steps where there is a signal to mark: hollow while they are likely, solid once they count. */
  #marks({ fromS, bottom, x, y }, nowMs, motion) {
    const onSignal = ({ atS, peak }) => {
      const g = peak ?? this.#trace.valueAt(atS);
      return g === null ? PAD.top + 6 : y(g);
    };
    const begun = Math.max(fromS - 0.2, this.#trace.beginS);
    const shown = ({ atS }) => atS >= begun;
    for (const step of this.#trace.likely.filter(shown)) {
      const mark = this.#shape(step.counter, x(step.atS), onSignal(step), 4.5);
      paintLikely(this.#context, mark.shape, { ...mark.paint, alpha: presence(step, nowMs, motion) });
    }
    for (const step of this.#trace.steps.filter((step) => step.onSignal && shown(step))) {
      this.#counted(step, x(step.atS), onSignal(step), bottom, presence(step, nowMs, motion));
    }
  }

  #shape(counter, x, y, radius) {
    const colour = this.#colours[look(counter).colour];
    return { shape: outline(counter, x, y, radius), paint: { colour, ground: this.#colours.card } };
  }

  /** A step that was not likely before rings once; one that was becomes solid. */
  #counted({ counter, wasLikely }, x, y, bottom, age) {
    const c = this.#context;
    const { shape, paint } = this.#shape(counter, x, y, 5);
    c.strokeStyle = paint.colour;
    c.lineWidth = 1;
    c.globalAlpha = 0.22;
    this.#line(x, y, x, bottom);
    if (age < 1 && !wasLikely) {
      c.globalAlpha = 1 - age;
      c.lineWidth = 2;
      c.stroke(outline(counter, x, y, 5 + 14 * age));
    }
    if (age < 1 && wasLikely) paintLikely(c, shape, paint);
    paintCounted(c, shape, { ...paint, alpha: wasLikely ? age : 1 });
  }

  #line(x1, y1, x2, y2) {
    const c = this.#context;
    c.beginPath();
    c.moveTo(x1, y1);
    c.lineTo(x2, y2);
    c.stroke();
  }
}
