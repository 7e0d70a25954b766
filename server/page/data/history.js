// The server's counters over the last minutes, in rings of fixed size.

import { number } from "./store.js";

export const SPAN_S = 300;
const POINTS = 640; // SPAN_S at two a second, and some
const RATE_WINDOW_S = 5;
const COLUMNS = ["time", "queued", "done", "busy_s", "cpu_s", "running"];

/** Counters as numbers. */
export function toCounters(message) {
  const counters = Object.fromEntries(Object.entries(message ?? {}).map(([name, value]) => [name, number(value)]));
  counters.done = (counters.answered_total ?? 0) + (counters.updates_total ?? 0);
  return counters;
}

export class History {
  #columns = Object.fromEntries(COLUMNS.map((name) => [name, new Float64Array(POINTS)]));
  #count = 0;

  clear() {
    this.#count = 0;
  }

  /** `time` in seconds, rising. */
  put(time, counters) {
    const at = this.#count++ % POINTS;
    const values = { time, queued: counters.queued, done: counters.done, busy_s: counters.busy_s_total,
                     cpu_s: counters.cpu_s_total, running: counters.running };
    for (const name of COLUMNS) this.#columns[name][at] = values[name] ?? 0;
  }

  /** Points kept; 0 is the oldest. */
  get length() {
    return Math.min(this.#count, POINTS);
  }
  value(name, index) {
    return this.#columns[name][(this.#count - this.length + index) % POINTS];
  }

  // The oldest point within `window_s` before point `index`.
  #before(index, window_s) {
    const until = this.value("time", index) - window_s;
    while (index > 0 && this.value("time", index - 1) >= until) --index;
    return index;
  }

  /** What a counter grew a second over the last seconds before a point; NaN where that is not known. */
  growth(name, index = this.length - 1, window_s = RATE_WINDOW_S) {
    if (index < 1) return NaN;
    const first = this.#before(index, window_s);
    const elapsed_s = this.value("time", index) - this.value("time", first);
    return elapsed_s > 0 ? (this.value(name, index) - this.value(name, first)) / elapsed_s : NaN;
  }
}
