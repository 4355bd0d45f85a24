/**
 * The last seconds of one device's filtered signal, with what was decided on it.
 *
 * Everything lies on device time. `edge(nowMs)` says which device time belongs at the plot's right edge: the newest
 * sample's time carried on by the viewer's clock, LATE_S behind it, so that uneven arrival does not shake the picture.
 */

/** Samples kept: 40 s at 50 Hz, far more than any plot shows. */
const CAPACITY = 2048;
const KEPT_S = 35;
/** How far the right edge stays behind the newest sample: longer than the usual pause between two messages. */
const LATE_S = 0.4;
/** How fast the estimate of the device's clock follows a slower one; crystals differ by far less. */
const LEAK = 0.01;
/** A jump of the device's time beyond this is shown at once and not glided to. */
const JUMP_S = 1;
const GLIDE_PER_S = 4;
/** How long a mark takes to come up or to go. */
const FADE_MS = 450;
/** Half a sample: what is told of the same step twice lies closer. */
const SAME_S = 0.01;

/** Return how far a mark is there, in [0, 1]: it comes up when it is born and goes when it is taken back. */
export function presence({ bornMs, goneMs = null }, nowMs, motion = true) {
  if (!motion) return goneMs === null ? 1 : 0;
  const here = Math.min(1, Math.max(0, (nowMs - bornMs) / FADE_MS));
  return goneMs === null ? here : Math.max(0, here - (nowMs - goneMs) / FADE_MS);
}

export class Trace {
  rateHz = 50;
  bands = [];
  /** Counted steps of every counter; those `onSignal` are the primary's. */
  steps = [];
  /** Steps of the primary that are likely, and those taken back a moment ago. */
  likely = [];
  gaps = [];
  #values = new Float32Array(CAPACITY).fill(NaN);
  #begin = null;
  #end = null;
  #offsetS = null;
  #arrivedS = 0;
  #shownS = null;
  #drawnS = 0;

  /** Forget everything: the device's time began anew. */
  reset() {
    this.bands = [];
    this.steps = [];
    this.likely = [];
    this.gaps = [];
    this.#values.fill(NaN);
    this.#begin = null;
    this.#end = null;
    this.#offsetS = null;
    this.#shownS = null;
  }

  /** Take a "signal" message that arrived at `nowMs` of the viewer's monotonic clock. */
  addSignal({ from_s, rate_hz, values, bands = [] }, nowMs) {
    const start = Math.round(from_s * rate_hz);
    const backwards = this.#end !== null && start < this.#end - CAPACITY / 4;
    if (backwards || rate_hz !== this.rateHz) this.reset();
    this.rateHz = rate_hz;
    this.#write(start, values);
    for (const band of bands) this.#addBand(band);
    if (values.length) this.#follow(this.#end / rate_hz, nowMs / 1000);
    this.#prune();
  }

  /** Take a counted "step"; a repeated one changes nothing. `onSignal` says that it is the primary's. */
  addStep({ ordinal, counter, device_s, peak }, nowMs, onSignal = true) {
    if (this.steps.some((step) => step.ordinal === ordinal)) return;
    const before = this.likely.length;
    if (onSignal) this.likely = this.likely.filter(({ atS }) => Math.abs(atS - device_s) > SAME_S);
    const wasLikely = this.likely.length < before;
    const height = peak ?? this.valueAt(device_s);
    this.steps.push({ ordinal, counter, atS: device_s, peak: height, bornMs: nowMs, onSignal, wasLikely });
  }

  /**
   * Take a "tentative" message of the primary, `counter`: a likely step, or one that is taken back.
   * Those that do not pass the thresholds in force are for navigation; at rest they would flicker.
   */
  addTentative({ status, device_s, passes = true }, nowMs, counter) {
    const known = this.likely.find(({ atS, goneMs }) => goneMs === null && Math.abs(atS - device_s) <= SAME_S);
    if (status === "retracted" && known) known.goneMs = nowMs;
    if (status !== "likely" || known || !passes) return;
    this.likely.push({ counter, atS: device_s, peak: null, bornMs: nowMs, goneMs: null });
  }

  /** Take a "gap": `filled` ones were interpolated and are drawn as signal. */
  addGap({ from_s, to_s, filled }) {
    if (!filled) this.gaps.push({ fromS: from_s, toS: to_s });
  }

  /** Return the device time at the right edge, or null before the first sample. */
  edge(nowMs) {
    if (this.#offsetS === null) return null;
    const nowS = nowMs / 1000;
    const away = this.#offsetS - (this.#shownS ?? this.#offsetS);
    const glide = Math.abs(away) > JUMP_S ? 1 : 1 - Math.exp(-Math.max(0, nowS - this.#drawnS) * GLIDE_PER_S);
    this.#shownS = (this.#shownS ?? this.#offsetS) + away * glide;
    this.#drawnS = nowS;
    return nowS + this.#shownS - LATE_S;
  }

  /** Return the device time of the first sample ever, or null: before it nothing is missing. */
  get beginS() {
    return this.#begin === null ? null : this.#begin / this.rateHz;
  }

  /** Return what the last KEPT_S up to the device time `edge` hold: `{signal, upper, lower}`, each true or false. */
  carried(edge) {
    const holds = (name) => this.bands.some((band) => band[name] != null);
    return { signal: edge !== null, upper: holds("upper"), lower: holds("lower") };
  }

  /** Return the signal at grid index `k` in g; NaN where there is none. */
  at(k) {
    return this.#end === null || k >= this.#end || k < this.#end - CAPACITY ? NaN : this.#values[k & (CAPACITY - 1)];
  }

  /** Return the signal at device time `s` in g; null where there is none. */
  valueAt(s) {
    const value = this.at(Math.round(s * this.rateHz));
    return Number.isNaN(value) ? null : value;
  }

  #write(start, values) {
    const end = start + values.length;
    const from = Math.max(this.#end ?? start, end - CAPACITY);
    for (let k = from; k < start; k += 1) this.#values[k & (CAPACITY - 1)] = NaN;
    values.forEach((value, i) => {
      this.#values[(start + i) & (CAPACITY - 1)] = value ?? NaN;
    });
    this.#begin ??= start;
    this.#end = Math.max(this.#end ?? end, end);
  }

  #addBand(band) {
    const known = this.bands.findIndex(({ from_s }) => from_s === band.from_s);
    if (known >= 0) this.bands[known] = band;
    else this.bands.push(band);
  }

  /** Hold on to the least delayed arrival: the largest difference of device and viewer clock, leaking slowly. */
  #follow(endS, nowS) {
    const sample = endS - nowS;
    const held = this.#offsetS === null ? sample : this.#offsetS - LEAK * (nowS - this.#arrivedS);
    this.#offsetS = Math.max(sample, held);
    this.#arrivedS = nowS;
  }

  #prune() {
    const oldestS = this.#end / this.rateHz - KEPT_S;
    this.bands = this.bands.filter(({ to_s }) => to_s > oldestS);
    this.steps = this.steps.filter(({ atS }) => atS > oldestS);
    this.likely = this.likely.filter(({ atS }) => atS > oldestS);
    this.gaps = this.gaps.filter(({ toS }) => toS > oldestS);
  }
}
