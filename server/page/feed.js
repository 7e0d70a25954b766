// A stream of events that reconnects after a lost connection, a timeout or a restart of the server.

const FIRST_RETRY_S = 0.5;
const LAST_RETRY_S = 15;

/**
 * Callbacks in `on`: event(name, data), phase({phase, retryAt, reason, lastFresh}), refused(ApiError) → true to retry.
 * Phases: connecting, live, retrying, stopped. `silence_s`: a stream without data for this time counts as lost.
 */
export class Feed {
  #abort = null;
  #wake = null;
  #retries = 0;
  #stopped = false;
  #lastFresh = null;

  constructor(api, path, on, silence_s = Infinity) {
    this.api = api;
    this.path = path;
    this.on = on;
    this.silence_s = silence_s;
    this.#run();
  }

  stop() {
    this.#stopped = true;
    this.#abort?.abort();
    this.#wake?.();
  }
  /** Connects at once. */
  retryNow() {
    this.#wake?.();
  }

  async #run() {
    while (!this.#stopped) {
      const reason = await this.#connect();
      if (this.#stopped || reason === null) break;
      await this.#pause(reason);
    }
    this.#report("stopped");
  }

  // Reads until the end. Returns the reason for a retry, or null if there must be none.
  async #connect() {
    this.#report("connecting");
    this.#abort = new AbortController();
    let timer = 0;
    const listen = () => {
      clearTimeout(timer);
      if (Number.isFinite(this.silence_s)) timer = setTimeout(() => this.#abort.abort(), 1000 * this.silence_s);
    };
    try {
      listen();
      for await (const { name, data } of this.api.events(this.path, this.#abort.signal)) {
        if (this.#stopped) return null;
        listen();
        this.#retries = 0;
        this.#lastFresh = Date.now();
        this.#report("live");
        if (data !== null) this.on.event(name, data);
        if (name === "end") return null;
      }
      return "the server closed the connection";
    } catch (error) {
      if (this.#stopped) return null;
      if (error.status !== undefined) return (await this.on.refused(error)) ? error.message : null;
      return this.#abort.signal.aborted ? `no data for ${this.silence_s} s` : "the server cannot be reached";
    } finally {
      clearTimeout(timer);
    }
  }

  async #pause(reason) {
    const wait_s = Math.min(LAST_RETRY_S, FIRST_RETRY_S * 2 ** this.#retries);
    ++this.#retries;
    this.#report("retrying", { reason, retryAt: Date.now() + 1000 * wait_s });
    await new Promise((resolve) => {
      const timer = setTimeout(resolve, 1000 * wait_s);
      this.#wake = () => {
        clearTimeout(timer);
        resolve();
      };
    });
    this.#wake = null;
  }

  #report(phase, more = {}) {
    this.on.phase?.({ phase, lastFresh: this.#lastFresh, ...more });
  }
}
