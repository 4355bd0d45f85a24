/**
 * The page: feeds messages to the devices, keeps a card for each, and draws once a frame.
 *
 * Text follows messages at most once a frame; plots follow the clock. With reduced motion the plots are redrawn once a
 * second. What a screen reader hears is rate-limited: counts every ANNOUNCE_MS, states at once.
 */

import { of, request } from "./api.js";
import { Card } from "./card.js";
import { CountersDialog } from "./counters_dialog.js";
import { Devices } from "./devices.js";
import { Feed } from "./feed.js";
import { duration, localTime, zone } from "./format.js";
import { counts, shownState, spokenCount } from "./primary.js";
import { Trials } from "./trials.js";

const ANNOUNCE_MS = 10_000;
const SECOND_MS = 1_000;
const HEALTH_MS = 5_000;
const ANSWER_MS = 2_000;

const $ = (id) => document.getElementById(id);
const devices = new Devices();
const cards = new Map();
const counters = new CountersDialog($("counters"));
const trials = new Trials($("trials"));
const still = matchMedia("(prefers-reduced-motion: reduce)");
const server = { state: "connecting", retryAtMs: null, lostAt: null, known: false };
const spoken = { atMs: 0, text: "", states: new Map() };
let dirty = true;
let drawnMs = 0;

const live = new URL("api/v1/live", document.baseURI);
live.protocol = live.protocol.replace("http", "ws");
const feed = new Feed(live, { onMessage: receive, onState: follow });

function receive(message) {
  if (message.type === "snapshot") server.known = true;
  dirty = devices.apply(message, performance.now()) || dirty;
}

function follow({ state, retryAtMs }) {
  server.state = state;
  server.retryAtMs = retryAtMs;
  if (state === "open") server.lostAt = null;
  else if (state === "waiting") server.lostAt ??= new Date();
  dirty = true;
  showServer();
}

function showServer() {
  const { state, retryAtMs, lostAt } = server;
  const words = { connecting: "Connecting to the server…", open: "Server connected", waiting: "Server not reached" };
  $("server").textContent = words[state];
  document.querySelector(".server").dataset.state = state;
  document.body.classList.toggle("cut", lostAt !== null);
  $("banner").hidden = lostAt === null;
  if (lostAt === null) return;
  setText("banner-what", server.known
    ? `The connection to the server was lost at ${localTime(lostAt)}.` : "The server cannot be reached.");
  setText("banner-next", retryAtMs === null ? "Trying again…"
    : `Trying again in ${duration((retryAtMs - Date.now() + 999) / 1000)}.`);
}

function setText(id, text) {
  if ($(id).textContent !== text) $(id).textContent = text;
}

async function act(device, verb) {
  const { status, error } = await request(of(device, verb), { method: "POST" });
  dirty = true;
  if (error === null) return null;
  return status === 0 ? `The server did not answer the request to ${verb}. Try again when it is back.`
    : `The server refused to ${verb}: ${status} ${error}`;
}

function choose(device) {
  counters.open(device, (sentence) => {
    $("announce").textContent = sentence;
  });
}

function showDevices() {
  const entries = devices.all;
  for (const [entry, card] of cards) {
    if (entries.includes(entry)) continue;
    card.close();
    cards.delete(entry);
  }
  for (const entry of entries) {
    if (!cards.has(entry)) {
      const card = new Card($("card"), entry.trace, { act, choose });
      cards.set(entry, card);
      $("devices").append(card.element);
      card.restyle();
    }
    cards.get(entry).show(entry.device, devices.serverNow(), server.lostAt !== null);
  }
  const empty = entries.length === 0 && server.known;
  if (empty && $("empty").hidden) setTimeout(showTrouble);
  $("empty").hidden = !empty;
  $("devices").classList.toggle("several", entries.length > 1);
  trials.show(entries.map(({ device }) => device));
  document.title = entries.length === 1 ? `${counts(entries[0].device).now} steps · steplink` : "steplink";
}

/** Say what does not work on the server: its store, and, while there is no bracelet, its Bluetooth. */
async function showTrouble() {
  if (server.state !== "open") return;
  const { value: health } = await request("healthz", { timeoutMs: ANSWER_MS });
  $("trouble").hidden = !health?.reason;
  setText("trouble", health?.reason ? `Bluetooth does not work on the server: ${health.reason}` : "");
  $("store-trouble").hidden = !health?.store_reason;
  const now = "Steps are counted but not stored for now";
  setText("store-trouble", health?.store_reason ? `${now}: ${health.store_reason}` : "");
}

function announce(nowMs) {
  for (const { device } of devices.all) {
    const before = spoken.states.get(device.id);
    const state = shownState(device);
    spoken.states.set(device.id, state);
    if (before === undefined || before === state) continue;
    $("announce").textContent = `${device.name}: ${state === "faulted" ? "not counting" : state}`;
  }
  if (nowMs - spoken.atMs < ANNOUNCE_MS) return;
  const text = devices.all.map(({ device }) => `${device.name}: ${spokenCount(device)}`).join(", ");
  if (text !== spoken.text) $("announce").textContent = text;
  spoken.atMs = nowMs;
  spoken.text = text;
}

function frame(nowMs) {
  requestAnimationFrame(frame);
  if (dirty) {
    dirty = false;
    showDevices();
    announce(nowMs);
  }
  if (still.matches && nowMs - drawnMs < SECOND_MS) return;
  drawnMs = nowMs;
  for (const card of cards.values()) card.draw(nowMs, { motion: !still.matches });
}

function restyle() {
  for (const card of cards.values()) card.restyle();
}

$("zone").textContent = zone();
$("retry").addEventListener("click", () => feed.connect());
window.addEventListener("online", () => feed.connect());
document.addEventListener("visibilitychange", () => document.hidden || feed.connect());
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", restyle);
setInterval(() => {
  dirty = true;
  showServer();
}, SECOND_MS);
setInterval(showTrouble, HEALTH_MS);
feed.connect();
requestAnimationFrame(frame);
