// The iterations of one job, of limited number: longer traces are thinned evenly.

import { numbers, toRow } from "./store.js";

const MAX_ROWS = 1024;
const MAX_FRAMES = 64;

const toFrame = (message) => ({
  ...numbers(message, ["iteration", "kappa"]),
  s: Float64Array.from(message.s ?? [], Number),
  t: Float64Array.from(message.t ?? [], Number),
});

/** A list that keeps every k-th item, and the newest. */
class Thinned {
  items = [];
  #every = 1;
  #count = 0;
  #newestStays = true;

  constructor(most) {
    this.most = most;
  }
  clear() {
    this.items = [];
    this.#every = 1;
    this.#count = 0;
    this.#newestStays = true;
  }
  put(item) {
    if (!this.#newestStays) this.items.pop();
    this.#newestStays = this.#count++ % this.#every === 0;
    this.items.push(item);
    if (this.items.length > this.most) {
      this.items = this.items.filter((_, index) => index % 2 === 0);
      this.#every *= 2;
    }
  }
}

export class Trace {
  #rows = new Thinned(MAX_ROWS);
  #frames = new Thinned(MAX_FRAMES);

  /** Oldest first. */
  get rows() {
    return this.#rows.items;
  }
  /** {iteration, kappa, s, t}, oldest first. */
  get frames() {
    return this.#frames.items;
  }

  /** Replaces everything by the trace of the server. */
  replace(message) {
    this.#rows.clear();
    this.#frames.clear();
    for (const row of message?.rows ?? []) this.#rows.put(toRow(row));
    for (const frame of message?.pairs ?? []) this.#frames.put(toFrame(frame));
  }

  /** Adds new rows. An iteration number below the last one begins another solve of a session. */
  add(rows = [], pairs = null) {
    for (const message of rows) {
      const row = toRow(message);
      if (row.iteration < (this.rows.at(-1)?.iteration ?? 0)) {
        this.#rows.clear();
        this.#frames.clear();
      }
      this.#rows.put(row);
    }
    if (pairs === null || !(pairs.s?.length > 0)) return;
    const frame = toFrame(pairs);
    const last = this.frames.at(-1)?.iteration ?? -1;
    if (frame.iteration > last) this.#frames.put(frame);
  }
}

/**
 * Nodes per second at each row, averaged over the last tenth of the time because rows come in bursts. NaN before the
 * tree.
 */
export function nodeRates(rows) {
  let from = 0;
  return rows.map((row, at) => {
    if (row.nodes === 0) {
      from = at; // the tree begins later
      return NaN;
    }
    while (from + 1 < at && rows[from + 1].elapsed_s <= 0.9 * row.elapsed_s) ++from;
    const seconds = row.elapsed_s - rows[from].elapsed_s;
    return seconds > 0 ? (row.nodes - rows[from].nodes) / seconds : NaN;
  });
}

/**
 * Rows whose step took more than one factorization: regularization was raised and the factorization repeated. Rows of
 * a local search (kappa = 0) are whole solves of a branch and do not count.
 */
export function repeated(rows) {
  return rows.map((row, index) => {
    const before = rows[index - 1];
    if (before === undefined || row.kappa === 0 || before.kappa === 0) return 0;
    return Math.max(0, row.factorizations - before.factorizations - (row.iteration - before.iteration));
  });
}
