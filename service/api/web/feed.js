/**
 * The live feed: one WebSocket at a time, made again for ever.
 *
 * Every connection begins with a fresh snapshot, so nothing needs to be remembered over a loss. An attempt that brings
 * no snapshot within SNAPSHOT_MS counts as failed: a half-open connection must not look like an idle one.
 */

const SNAPSHOT_MS = 8_000;
const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 15_000;
/** A connection that lasted this long was healthy: the next loss is retried quickly again. */
const HEALTHY_MS = 5_000;
/** Close code of the service for a client that was too slow. */
export const TOO_SLOW = 4408;

/** Return how long to wait before attempt `attempt` (0 is the first after a loss), in ms; `random` in [0, 1). */
export function waitMs(attempt, random) {
  const full = Math.min(LONGEST_WAIT_MS, FIRST_WAIT_MS * 2 ** Math.min(attempt, 10));
  return full * (0.5 + 0.5 * random);
}

export class Feed {
  #url;
  #onMessage;
  #onState;
  #socket = null;
  #timer = 0;
  #attempt = 0;
  #openedMs = 0;

  /** `onMessage(message)` gets each JSON object; `onState({state, retryAtMs})` gets "connecting", "open", "waiting". */
  constructor(url, { onMessage, onState }) {
    this.#url = url;
    this.#onMessage = onMessage;
    this.#onState = onState;
  }

  /** Connect now, whatever the back-off says; nothing happens while a connection stands or is being made. */
  connect() {
    if (this.#socket) return;
    clearTimeout(this.#timer);
    this.#onState({ state: "connecting", retryAtMs: null });
    const socket = new WebSocket(this.#url);
    this.#socket = socket;
    this.#timer = setTimeout(() => this.#lost(socket), SNAPSHOT_MS);
    socket.onmessage = (event) => this.#receive(socket, event.data);
    socket.onclose = () => this.#lost(socket);
  }

  #receive(socket, text) {
    if (socket !== this.#socket) return;
    const message = parsed(text);
    if (message === null) return;
    if (message.type === "lagging") {
      this.#lost(socket);
      return;
    }
    if (message.type === "snapshot") {
      clearTimeout(this.#timer);
      this.#openedMs = Date.now();
      this.#onState({ state: "open", retryAtMs: null });
    }
    this.#onMessage(message);
  }

  #lost(socket) {
    if (socket !== this.#socket) return;
    clearTimeout(this.#timer);
    this.#socket = null;
    socket.close();
    const healthy = this.#openedMs > 0 && Date.now() - this.#openedMs > HEALTHY_MS;
    this.#attempt = healthy ? 0 : this.#attempt;
    this.#openedMs = 0;
    const wait = waitMs(this.#attempt, Math.random());
    this.#attempt += 1;
    this.#timer = setTimeout(() => this.connect(), wait);
    this.#onState({ state: "waiting", retryAtMs: Date.now() + wait });
  }
}

function parsed(text) {
  try {
    const message = JSON.parse(text);
    return message && typeof message.type === "string" ? message : null;
  } catch {
    return null;
  }
}
