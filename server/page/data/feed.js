// A stream of events that comes back by itself: after a break, a silence or a server's restart.

const FIRST_RETRY_S = 0.5;
const LAST_RETRY_S = 15;

/**
 * `on` holds what to do: event(name, data), phase({phase, retryAt, reason, lastFresh}), refused(ApiError) → true to go on.
 * Phases: connecting, live, retrying, stopped. `silence_s`: a stream that says nothing for so long counts as dead.
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
  /** Connects at once instead of waiting on. */
  retryNow() {
    this.#wake?.();
  }

  async #run() {
    while (!this.#stopped) {
      const reason = await this.#connect();
      if (this.#stopped || reason === null) break;
      await this.#pause(reason);
    }
    this.#tell("stopped");
  }

  // Reads until the end; why it ended, or null if it shall not be tried again.
  async #connect() {
    this.#tell("connecting");
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
        this.#tell("live");
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
    this.#tell("retrying", { reason, retryAt: Date.now() + 1000 * wait_s });
    await new Promise((resolve) => {
      const timer = setTimeout(resolve, 1000 * wait_s);
      this.#wake = () => {
        clearTimeout(timer);
        resolve();
      };
    });
    this.#wake = null;
  }

  #tell(phase, more = {}) {
    this.on.phase?.({ phase, lastFresh: this.#lastFresh, ...more });
  }
}
