// The server's counters over the last minutes, in ring buffers: from the server's history and from the stream.

export const SPAN_S = 300;
const POINTS = 640; // SPAN_S with two per second, and some more
const RATE_WINDOW_S = 5;
const COLUMNS = ["time", "queued", "done", "busy_s", "cpu_s", "running", "p50_s", "p99_s"];

/** Counters as numbers. */
export function toCounters(message) {
  const of = (value) => (value === null ? NaN : Number(value)); // null: no job has finished
  const counters = Object.fromEntries(Object.entries(message ?? {}).map(([name, value]) => [name, of(value)]));
  counters.done = (counters.answered_total ?? 0) + (counters.updates_total ?? 0);
  return counters;
}

export class History {
  #columns = Object.fromEntries(COLUMNS.map((name) => [name, new Float64Array(POINTS)]));
  #count = 0;

  clear() {
    this.#count = 0;
  }

  /** Adds counters at `time` in seconds, unless the newest point is as late. */
  put(time, counters) {
    this.#add({ time, queued: counters.queued, done: counters.done, busy_s: counters.busy_s_total, cpu_s: counters.cpu_s_total,
                running: counters.running, p50_s: counters.p50_s, p99_s: counters.p99_s });
  }
  /** Puts the columns of the server's history before the points of this page. */
  replace({ time_s: time = [], ...columns }) {
    const own = Array.from({ length: this.length }, (_, index) => Object.fromEntries(COLUMNS.map((name) => [name, this.value(name, index)])));
    this.clear();
    time.forEach((at, index) => this.#add({ ...Object.fromEntries(COLUMNS.map((name) => [name, columns[name]?.[index] ?? NaN])), time: at }));
    for (const point of own) this.#add(point);
  }

  #add(point) {
    if (this.#count > 0 && !(point.time > this.value("time", this.length - 1))) return;
    const at = this.#count++ % POINTS;
    for (const name of COLUMNS) this.#columns[name][at] = point[name] ?? NaN;
  }

  /** The number of points; 0 is the oldest. */
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

  /** The growth of a counter per second, over the last seconds before a point; NaN if unknown. */
  growth(name, index = this.length - 1, window_s = RATE_WINDOW_S) {
    if (index < 1) return NaN;
    const first = this.#before(index, window_s);
    const elapsed_s = this.value("time", index) - this.value("time", first);
    return elapsed_s > 0 ? (this.value(name, index) - this.value(name, first)) / elapsed_s : NaN;
  }
}
