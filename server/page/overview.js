// The cards with the current state of the server.

import { byId, fill, make } from "./dom.js";
import { bytes, duration, percent, rate, whole } from "./format.js";
import { TimePlot } from "./time_plot.js";

const MAX_CELLS = 64;
const PRIORITIES = ["realtime", "interactive", "batch"];

export class Overview {
  /** @type {TimePlot[]} */
  #plots;
  #workers = 0;

  /** `history` of the counters, filled by the caller. */
  constructor(history) {
    this.history = history;
    const latency = [{ words: "p50", colour: "--teal", value: (index) => history.value("p50_s", index) },
                     { words: "p99", colour: "--purple", value: (index) => history.value("p99_s", index) }];
    this.#plots = [
      new TimePlot(byId("plot-busy"), { words: "Workers busy", text: rate, most: () => Math.max(1, this.#workers),
                                        curves: [{ colour: "--blue", value: (index) => history.growth("busy_s", index, 2) }] }),
      new TimePlot(byId("plot-queue"), { words: "Jobs waiting", text: whole, curves: [{ colour: "--orange", value: (index) => history.value("queued", index) }] }),
      new TimePlot(byId("plot-rate"), { words: "Solves per second", text: rate, curves: [{ colour: "--green", value: (index) => history.growth("done", index) }] }),
      new TimePlot(byId("plot-latency"), { words: "Time from acceptance to result", text: duration, logarithmic: true, curves: latency }),
    ];
  }

  /** Shows current counters, number of workers and limits. */
  show(counters, workers, limits) {
    this.#workers = workers;
    this.#showWorkers(counters.running, workers);
    fill(byId("queued"), whole(counters.queued));
    for (const priority of PRIORITIES) {
      fill(byId(`queued-${priority}`), whole(counters[`queued_${priority}`]));
      fill(byId(`wait-${priority}`), `wait ${duration(counters[`estimated_wait_${priority}_s`])}`);
    }
    this.#showRate(counters);
    fill(byId("p50"), duration(counters.p50_last_minute_s));
    fill(byId("p99"), duration(counters.p99_last_minute_s));
    const cpu = this.history.growth("cpu_s");
    fill(byId("memory"), bytes(counters.resident_bytes));
    fill(byId("cpu"), Number.isFinite(cpu) ? `${cpu.toFixed(2)} cores` : "–");
    fill(byId("sessions"), `${whole(counters.sessions)} of ${whole(Number(limits?.sessions))}`);
    fill(byId("session-memory"), bytes(counters.session_bytes));
    fill(byId("results"), bytes(counters.result_bytes));
    for (const name of ["accepted", "answered", "solved", "updates", "cancelled", "refused", "failed"]) {
      fill(byId(name), whole(counters[`${name}_total`]));
    }
    byId("failed").classList.toggle("alarm", counters.failed_total > 0);
    for (const plot of this.#plots) plot.show(this.history);
  }

  #showWorkers(busy, workers) {
    fill(byId("busy"), whole(busy));
    fill(byId("workers"), whole(workers));
    const cells = byId("worker-cells");
    const count = Math.min(workers, MAX_CELLS);
    if (cells.childElementCount !== count) cells.replaceChildren(...Array.from({ length: count }, () => make("span")));
    const lit = Math.round((count * Math.min(busy, workers)) / Math.max(1, workers));
    [...cells.children].forEach((cell, index) => cell.classList.toggle("on", index < lit));
  }

  // The server counts the last minute, which includes the time before the page was opened.
  #showRate({ answered_last_minute: answered, solved_last_minute: solved }) {
    fill(byId("rate"), rate(this.history.growth("done")));
    const success = byId("success");
    fill(success, answered > 0 ? `${percent(solved / answered)} solved, last minute` : "none finished in the last minute");
    success.title = `${whole(solved)} of ${whole(answered)} solves in the last minute`;
  }
}
