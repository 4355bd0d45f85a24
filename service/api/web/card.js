/**
 * One device's card: its elements, filled from a Device, and its plot.
 *
 * A card writes only what changed, so that selection, focus and a screen reader's place stay where they are.
 */

import { CalibrationPanel } from "./calibration_panel.js";
import { UNKNOWN, deviation, duration, localTime, measured, percent, plural, uncertain, whole } from "./format.js";
import { gaitWords, refusedWords } from "./gait.js";
import { Lanes, glyph } from "./lanes.js";
import { look } from "./looks.js";
import { Plot } from "./plot.js";
import { counts, faultNotice, primaryFault, shownState } from "./primary.js";

/** State in words; the icon has the same name. */
const STATES = {
  seen: "In range, not connected",
  connecting: "Connecting…",
  streaming: "Live",
  faulted: "Live, not counting",
  lost: "Lost",
  disconnected: "Disconnected",
  stale: "Not up to date",
};
/** States in which the server holds the device or tries to; the button then offers to let it go. */
const HELD = new Set(["connecting", "streaming", "lost"]);
const LOW_BATTERY_PERCENT = 20;
const LEVEL_WIDTH = 17;

export class Card {
  element;
  #fields = {};
  #plot;
  #lanes;
  #trace;
  #panel = new CalibrationPanel();
  #tell;
  #device = null;
  #asked = null;
  #error = null;
  #before = null;
  #name = "";
  #steps = null;
  #recognises = null;

  /**
   * `tell.act(device, verb)` asks the server to "connect" or "disconnect" and resolves to an error's text or null;
   * `tell.choose(device)` opens the choice of its counters.
   */
  constructor(template, trace, tell) {
    this.element = template.content.firstElementChild.cloneNode(true);
    for (const node of this.element.querySelectorAll("[data-f]")) this.#fields[node.dataset.f] = node;
    this.#trace = trace;
    this.#plot = new Plot(this.#fields.canvas, trace);
    this.#lanes = new Lanes(this.#fields.lanes, trace);
    this.#tell = tell;
    this.#fields.tools.after(this.#panel.element);
    this.#fields.choose.addEventListener("click", () => tell.choose(this.#device));
    this.#fields.calibrate.addEventListener("click", () => this.#calibrate());
  }

  /** Fill the card from `device`; `now` is the server's clock; `stale` says that the server itself is not reached. */
  show(device, now, stale = false) {
    if (device.state !== this.#before) this.#error = null;
    this.#before = device.state;
    this.#device = device;
    this.#panel.show(device);
    this.#state(stale ? "stale" : shownState(device));
    this.#head(device, now);
    this.#numbers(device);
    this.#gait(device);
    this.#counters(device);
    this.#facts(device, now);
  }

  draw(nowMs, options) {
    const fault = this.#device && primaryFault(this.#device);
    this.#plot.draw(nowMs, { ...options, idle: Boolean(fault) });
    const edge = this.#trace.edge(nowMs);
    this.#lanes.draw(edge, nowMs, options);
    this.#key(fault ? {} : this.#trace.carried(edge));
  }

  restyle() {
    this.#plot.restyle();
    this.#lanes.restyle();
  }

  /** Explain what the plot shows, and nothing that it cannot show. */
  #key({ signal = false, upper = false, lower = false }) {
    for (const [name, shown] of Object.entries({ signal, upper, lower, step: signal, gap: signal })) {
      this.#fields[`key-${name}`].hidden = !shown;
    }
    const bands = upper || lower ? "its thresholds, " : "";
    this.#label(this.#fields.canvas, signal
      ? `The last ten seconds of ${this.#name}: ${look(this.#device.primary).signal}, ${bands}`
        + "and a mark at each counted step."
      : `The last ten seconds of ${this.#name}: no signal.`);
  }

  /** Take the card off the page. */
  close() {
    this.#panel.toggle(false);
    this.element.remove();
  }

  #calibrate() {
    const { calibrate } = this.#fields;
    const open = calibrate.getAttribute("aria-expanded") !== "true";
    calibrate.setAttribute("aria-expanded", String(open));
    this.#panel.toggle(open);
  }

  #state(state) {
    this.element.dataset.state = state;
    this.#fields.icon.setAttribute("href", `#i-${state in STATES ? state : "seen"}`);
    this.#text("state", STATES[state] ?? state);
  }

  #head(device, now) {
    const { manufacturer, model, firmware, id } = device;
    const name = device.name || model || id;
    this.#name = name;
    this.#text("name", name);
    const made = [manufacturer, model].filter(Boolean).join(" ");
    this.#text("model", [made, firmware && `firmware ${firmware}`, id].filter(Boolean).join(" · "));
    this.#text("notice", this.#error ?? notice(device, now));
    this.#fields.notice.hidden = !this.#fields.notice.textContent;
    this.#battery(device.battery_percent);
    this.#fields.lanes.setAttribute("aria-label", `Counters on ${name}`);
    this.#fields.choose.setAttribute("aria-label", `Counters of ${name}`);
    this.#fields.calibrate.setAttribute("aria-label", `Calibrate ${name}`);
    this.#button(device, name);
  }

  #battery(level) {
    this.#fields["battery-row"].hidden = level == null;
    this.#text("battery", measured(level, 0, "%"));
    this.#fields["battery-level"].setAttribute("width", String((LEVEL_WIDTH * (level ?? 0)) / 100));
    this.#fields["battery-row"].classList.toggle("low", (level ?? 100) < LOW_BATTERY_PERCENT);
  }

  #button(device, name) {
    const verb = HELD.has(device.state) ? "disconnect" : "connect";
    const { button } = this.#fields;
    this.#text("button", verb === "connect" ? "Connect" : "Disconnect");
    button.setAttribute("aria-label", `${button.textContent} ${name}`);
    button.classList.toggle("primary", verb === "connect");
    button.setAttribute("aria-disabled", String(this.#asked !== null));
    button.onclick = () => this.#ask(device, verb);
  }

  async #ask(device, verb) {
    if (this.#asked) return;
    this.#asked = verb;
    this.#error = null;
    this.#fields.button.setAttribute("aria-disabled", "true");
    this.#error = await this.#tell.act(device, verb);
    this.#asked = null;
  }

  #numbers(device) {
    const { steps_now, cadence_spm } = device;
    const { now, confirmed, pending } = counts(device);
    this.#text("steps-now", now);
    this.element.style.setProperty("--chars", Math.max(2, now.length));
    this.#text("steps", confirmed);
    this.#text("pending", `+${whole(pending)}`);
    this.#fields["pending-chip"].classList.toggle("none", pending === 0);
    this.element.classList.toggle("provisional", pending > 0);
    this.#text("cadence", shownState(device) === "streaming" ? whole(cadence_spm) : UNKNOWN);
    if (this.#steps !== null && steps_now > this.#steps) this.#beat();
    this.#steps = steps_now;
  }

  /** Whether somebody walks: its place stays while the primary is one that has said so before. */
  #gait(device) {
    const live = shownState(device) === "streaming";
    if (device.gait) this.#recognises = device.primary;
    const shown = this.#recognises === device.primary;
    const { verdict, word, sure } = gaitWords(live ? device : { gait: null });
    this.#fields["gait-row"].hidden = !shown;
    this.#fields["gait-row"].dataset.verdict = verdict;
    this.#fields["gait-icon"].setAttribute("href", `#g-${verdict}`);
    this.#text("gait", word);
    this.#text("gait-sure", sure);
    this.#text("refused", shown ? refusedWords(device) : "");
    this.#fields.refused.hidden = !this.#fields.refused.textContent;
  }

  #beat() {
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    if (!still) this.#fields["steps-now"].animate({ scale: [1.045, 1] }, { duration: 260, easing: "ease-out" });
  }

  #facts(device, now) {
    this.#text("packets", whole(device.packets));
    const odd = [[device.packets_bad, "bad"], [device.packets_duplicate, "repeated"], [device.packets_reordered, "late"]];
    this.#text("packets-more", odd.map(([count, word]) => `${whole(count ?? 0)} ${word}`).join(", "));
    this.#text("lost", percent(device.samples_lost, device.samples));
    const lost = `${whole(device.samples_lost)} of ${whole(device.samples_lost + device.samples)}`;
    this.#text("lost-more", [lost, awaited(device)].filter(Boolean).join("; "));
    this.#text("limit", whole(device.samples_saturated));
    this.#fields["limit-row"].hidden = !device.samples_saturated;
    this.#text("gaps", whole(device.gaps));
    this.#text("gaps-more", plural(device.reboots, "restart"));
    this.#rate(device);
    this.#drift(device);
    this.#text("rssi", measured(device.rssi_dbm, 0, "dBm"));
    this.#text("rssi-more", strength(device.rssi_dbm));
    this.#text("own", whole(device.register_steps));
    this.#fields["own-row"].hidden = device.register_steps == null;
    const since = device.session_since;
    this.#text("session", since ? localTime(since, now) : UNKNOWN);
    this.#text("session-more", since ? `for ${duration((now - new Date(since)) / 1000)}` : "not begun");
  }

  /** How fast it samples by its own clock: only digits that are known, and how far that is off what it says. */
  #rate({ rate_hz: nominal, measured_rate_hz: rate, measured_rate_uncertainty_hz: known }) {
    if (rate == null) {
      this.#text("rate", measured(nominal, 1, "Hz"));
      this.#text("rate-more", nominal == null ? "" : "nominal");
      return;
    }
    const [value, within] = uncertain(rate, known);
    const off = nominal == null ? null : deviation(rate, nominal, known);
    this.#text("rate", `${value}\u00a0Hz`);
    this.#text("rate-more", [within, nominal != null && `nominal\u00a0${nominal}`, off].filter(Boolean).join(", "));
  }

  /** How fast its clock runs. */
  #drift({ clock_drift_ppm: ppm, clock_drift_uncertainty_ppm: known }) {
    this.#text("drift", ppm == null ? UNKNOWN : `${uncertain(ppm, known, true).join(" ")}\u00a0ppm`);
    this.#text("drift-more", ppm == null ? "not known yet" : "against the server’s");
  }

  #counters(device) {
    const { primary } = device;
    this.#text("why", primaryFault(device) ?? "");
    this.#fields.why.hidden = !this.#fields.why.textContent;
    this.#lanes.show(device);
    this.element.style.setProperty("--lanes", this.#lanes.count);
    this.#text("axis", look(primary).signal);
    if (this.#fields["key-step"].dataset.counter === primary) return;
    this.#fields["key-step"].dataset.counter = primary;
    const likely = glyph(primary);
    likely.classList.add("likely");
    this.#fields["key-step"].replaceChildren(likely, "likely", glyph(primary), "counted step");
  }

  #label(node, text) {
    if (node.getAttribute("aria-label") !== text) node.setAttribute("aria-label", text);
  }

  #text(field, text) {
    const node = this.#fields[field];
    if (node.textContent !== text) node.textContent = text;
  }
}

/** Return the sentence under a card's head, or nothing where all is well. */
export function notice(device, now) {
  const { state, reason, since } = device;
  const why = reason ? ` (${reason})` : "";
  const at = localTime(since, now);
  if (state === "lost") {
    return `Contact lost at ${at}, ${duration((now - new Date(since)) / 1000)} ago${why}. `
      + "It comes back by itself once it is in range.";
  }
  if (state === "disconnected") return `Disconnected since ${at}${why}.`;
  const said = reason ? `${STATES[state] ?? state}: ${reason}` : "";
  return [faultNotice(device), said].filter(Boolean).join(" ");
}

/** Say what is being fetched, below the plot: a sentence above it would move the count when it comes and goes. */
function awaited({ samples_awaited: samples, measured_rate_hz: measuredHz, rate_hz: nominalHz }) {
  if (!samples) return "";
  const seconds = Math.ceil(samples / (measuredHz ?? nominalHz ?? 50));
  const length = seconds < 60 ? `${seconds}\u00a0s` : `${Math.floor(seconds / 60)}\u00a0min ${seconds % 60}\u00a0s`;
  return `${length} more are asked for, until then later steps are pending`;
}

function strength(dbm) {
  if (dbm == null) return "";
  if (dbm > -65) return "strong";
  return dbm > -80 ? "good" : "weak";
}
