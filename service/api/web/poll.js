/**
 * Asking again and again, one request at a time, at a pace that the answer decides.
 *
 * While the page is hidden nothing is asked; when it comes back the question is put at once.
 */

/** How long after a task that failed by a fault of the page it is tried again. */
const AFTER_FAULT_MS = 5_000;

export class Poll {
  #task;
  #timer = 0;
  #going = false;
  #busy = false;
  #again = false;

  /** `task()` asks once and resolves to the milliseconds until the next time. */
  constructor(task) {
    this.#task = task;
    document.addEventListener("visibilitychange", () => !document.hidden && this.#going && this.now());
  }

  /** Ask now, and go on asking until `stop()`. */
  now() {
    this.#going = true;
    clearTimeout(this.#timer);
    if (this.#busy) this.#again = true;
    else if (!document.hidden) this.#run();
  }

  stop() {
    this.#going = false;
    clearTimeout(this.#timer);
  }

  async #run() {
    this.#busy = true;
    this.#again = false;
    let waitMs = AFTER_FAULT_MS;
    try {
      waitMs = await this.#task();
    } finally {
      this.#busy = false;
      if (this.#going) this.#timer = setTimeout(() => this.now(), this.#again ? 0 : waitMs);
    }
  }
}
