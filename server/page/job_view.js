// The view of one job: result, convergence, pairs, options and times.

import { Convergence, loadCharts } from "./convergence.js";
import { confirm } from "./dialogs.js";
import { fill, make, onceAFrame } from "./dom.js";
import { conflictingParts, conflictingRows, explain, timeLimit } from "./findings.js";
import { duration, residual } from "./format.js";
import { Feed } from "./feed.js";
import { showCertificate, showConflict, showFacts, showOptions, showRows, showViolations } from "./job_tables.js";
import { buildJobPage } from "./job_page.js";
import { showStages } from "./stages_plot.js";
import { PairsPlot } from "./pairs_plot.js";
import { seconds, toJob } from "./store.js";
import { showTimings } from "./timings.js";
import { Trace } from "./trace.js";
import { outcome } from "./words.js";

const TABLES_EVERY_MS = 500;
const TICK_MS = 1000; // times advance without new rows
const MAX_TO_COMPARE = 30;

export class JobView {
  #job = null;
  #options = {};
  #trace = new Trace();
  #feed = null;
  #closed = false;
  #tablesAt = -Infinity;
  #timer = 0;
  #resultRead = false;
  #solution = null;
  #infeasibility = null;
  #offered = "";
  pairs = null; // a PairsPlot after the first frame

  /** `context` has api, info() (GetInfoResponse or null), jobs() (all of them), forget(id). */
  constructor(place, id, context) {
    this.id = id;
    this.context = context;
    this.parts = buildJobPage(place, id);
    this.update = onceAFrame(() => this.#draw());
    this.parts.download.addEventListener("click", () => this.#download("trace.csv", "csv"));
    this.parts.answer.addEventListener("click", () => this.#download("result", "json"));
    this.parts.compare.addEventListener("change", () => (location.hash = `#/jobs/${this.id}/with/${this.parts.compare.value}`));
    this.ticks = setInterval(() => this.#job !== null && this.#job.state !== "finished" && this.update(), TICK_MS);
    this.parts.bundle.addEventListener("click", () => this.#download("bundle", "tar.zst"));
    this.parts.cancel.addEventListener("click", () => this.#cancel());
    this.parts.axis.addEventListener("change", () => this.convergence?.alongTime(this.parts.axis.value === "time"));
    this.parts.table.addEventListener("toggle", () => this.#drawTables());
    this.#load();
  }

  close() {
    this.#closed = true;
    clearTimeout(this.#timer);
    clearInterval(this.ticks);
    this.update.cancel();
    this.#feed?.stop();
    this.convergence?.destroy();
    this.pairs?.destroy();
  }

  /** Loads everything again after a lost connection. */
  reload() {
    this.#feed?.stop();
    this.#feed = null;
    this.#load();
  }

  async #load() {
    try {
      await this.#get();
    } catch (error) {
      if (!this.#closed && error.status !== 401) this.#missing(error);
      return;
    }
    if (this.#closed) return;
    if (this.#job.state !== "finished" && this.#feed === null) this.#watch();
    await this.#makePlots();
  }

  async #get() {
    const answer = await this.context.api.get(`/api/jobs/${this.id}`);
    if (this.#closed) return;
    this.#job = toJob(answer.job);
    this.#options = answer.options ?? {};
    this.#infeasibility = answer.infeasibility ?? null;
    this.#trace.replace(answer.trace);
    this.#tablesAt = -Infinity;
    this.update();
  }

  async #makePlots() {
    const Chart = await loadCharts();
    if (this.#closed || this.convergence) return;
    this.convergence = new Convergence(this.parts.convergence, Chart);
    this.update();
  }

  #missing(error) {
    const gone = error.status === 404;
    this.parts.page.classList.add("gone");
    fill(this.parts.title, gone ? "No such job" : "This job cannot be shown");
    const why = gone ? "The server does not know this job: it was deleted, or newer jobs have replaced it in the history." : error.message;
    this.parts.why.replaceChildren(make("p", {}, why));
    this.parts.why.dataset.tone = "quiet";
    this.parts.status.hidden = true;
    if (gone) this.context.forget(this.id);
  }

  #watch() {
    this.#feed = new Feed(this.context.api, `/api/jobs/${this.id}/events`, {
      event: (name, data) => this.#event(name, data),
      refused: async (error) => error.status === 401,
    });
  }

  #event(name, data) {
    if (name === "end") {
      this.#feed = null;
      this.#load(); // final times and trace
      return;
    }
    if (name !== "job") return;
    for (const event of data.events ?? []) {
      this.#job = toJob(event.job);
      if (event.trace) this.#trace.replace(event.trace);
      this.#trace.add(event.trace ? [] : event.rows, event.pairs ?? null);
    }
    this.update();
  }

  #draw() {
    const job = this.#job;
    if (job === null || this.#closed) return;
    fill(this.parts.title, job.problem_name || `Job ${job.job_id.slice(0, 8)}`);
    const { word, tone, sign } = outcome(job);
    fill(this.parts.status, `${sign} ${word.replaceAll("_", " ")}`);
    this.parts.status.dataset.tone = tone;
    this.#drawPairs();
    this.convergence?.show(this.#rowsAndSolution(), this.#tolerances());
    const empty = this.#trace.rows.length === 0;
    this.parts.convergence.hidden = empty;
    this.parts.noRows.hidden = !empty;
    fill(this.parts.noRows, job.state === "finished" ? "No rows of progress were kept for this job." : "No iteration yet.");
    this.#drawTables();
  }

  // The solution was polished after the last row; it is the last point of the curves.
  #rowsAndSolution() {
    const rows = this.#trace.rows;
    const last = rows.at(-1);
    const { state, error, equality, inequality, complementarity, objective, times, incumbent, bound, gap, nodes, open_nodes } = this.#job;
    if (state !== "finished" || error || last === undefined) return rows;
    const elapsed_s = Math.max(last.elapsed_s, times.solve_s);
    const tree = last.nodes > 0 ? { incumbent, bound, gap, nodes, open_nodes } : {}; // the tree of a small problem has no rows
    return [...rows, { ...last, ...tree, elapsed_s, equality, inequality, complementarity, objective, kkt_residual: NaN, kappa: NaN, isSolution: true }];
  }

  #tolerances() {
    const names = ["equality", "inequality", "complementarity", "stationarity"];
    return Object.fromEntries(names.map((name) => [name, Number(this.#options[`${name}_tolerance`])]).filter(([, value]) => value > 0));
  }

  #drawPairs() {
    const { frames } = this.#trace;
    this.parts.pairs.hidden = frames.length === 0;
    this.parts.noPairs.hidden = frames.length > 0;
    if (frames.length > 0) {
      this.pairs ??= new PairsPlot(this.parts.pairs);
      const { state, complementarity } = this.#job;
      const note = state === "finished" ? `In the solution, polished afterwards, the largest |min(s, t)| is ${residual(complementarity)}.` : "";
      this.pairs.show(frames, this.#job.pairs, Number(this.#options.complementarity_tolerance ?? 1e-6), note);
      return;
    }
    const limits = this.context.info()?.limits;
    const job = this.#job;
    const why = job.pairs === 0 ? "This problem has no complementarity pairs."
      : Number(limits?.trace_pairs ?? 1) === 0 ? "This server stores none (--trace-pairs)."
      : job.iterations > 0 ? "None were stored for this job." : "None yet.";
    fill(this.parts.noPairs, why);
  }

  // Limits changes of text to a few per second.
  #drawTables() {
    const now = performance.now();
    const due = this.#tablesAt + TABLES_EVERY_MS;
    clearTimeout(this.#timer);
    if (now < due) {
      this.#timer = setTimeout(() => this.update(), due - now);
      return;
    }
    this.#tablesAt = now;
    const job = this.#job;
    const { tone, title, lines } = explain(job, this.#options, this.#trace.rows, this.#solution);
    this.parts.why.dataset.tone = tone;
    this.parts.why.replaceChildren(make("strong", {}, title), ...lines.map((line) => make("p", {}, line)));
    this.parts.stages.hidden = job.sample_average_stages.length === 0;
    if (job.sample_average_stages.length > 0) showStages(this.parts.stages, job.sample_average_stages);
    showFacts(this.parts.facts, job, this.#trace);
    showViolations(this.parts.violations, job, this.#options);
    showOptions(this.parts.options, this.#options, this.context.info()?.options ?? []);
    this.parts.timings.hidden = !(job.times.solve_s > 0);
    this.parts.noTimings.hidden = job.times.solve_s > 0;
    showTimings(this.parts.timings, job.times);
    this.#drawLimit();
    this.#drawConflict();
    if (this.parts.table.open) showRows(this.parts.rows, this.#trace.rows);
    this.#allowCancel();
  }

  // A client may cancel and download its own jobs, the role admin all.
  #allowCancel() {
    const info = this.context.info();
    const may = info !== null && (info.client === this.#job.client || (info.roles ?? []).includes("admin"));
    this.parts.cancel.hidden = !may || this.#job.state === "finished";
    this.parts.bundle.hidden = !may || this.#job.kind !== "submitted";
    this.parts.answer.hidden = this.parts.bundle.hidden || this.#job.state !== "finished";
    if (!this.parts.answer.hidden) this.#readResult();
    this.#offerComparison();
  }

  #drawLimit() {
    const limit = timeLimit(this.#job, this.#options);
    this.parts.limit.hidden = limit === null;
    if (limit === null) return;
    const text = `${duration(limit.used)} of at most ${duration(limit.limit)} (time_limit_s)`;
    this.parts.limit.replaceChildren(make("progress", { max: limit.limit, value: limit.used, "aria-label": "Time limit used" }), make("span", { class: "note" }, text));
  }

  // Reads the result once: only it contains the tests of the point.
  async #readResult() {
    if (this.#resultRead || this.#job.status !== "solved" || this.#job.proved) return;
    this.#resultRead = true;
    try {
      const { solution } = await this.context.api.get(`/api/jobs/${this.id}/result`);
      this.#solution = solution ?? null;
      if (!this.#closed) this.update();
    } catch {
      // The result is no longer stored.
    }
  }

  #drawConflict() {
    const why = this.#job.status === "infeasible" ? this.#infeasibility : null;
    this.parts.conflict.hidden = why === null;
    if (why === null) return;
    const conflict = conflictingParts(why);
    if (conflict.parts.length > 0) showConflict(this.parts.conflict, conflict);
    else showCertificate(this.parts.conflict, conflictingRows(this.#job, why), this.#options?.explain === true);
  }

  // Offers the newest jobs of the same problem: with the same name, or of the same size without one.
  #offerComparison() {
    const mine = this.#job;
    const alike = [...this.context.jobs()].filter((job) => job.job_id !== mine.job_id && job.state === "finished" && job.problem_name === mine.problem_name && (mine.problem_name !== "" || job.variables === mine.variables));
    alike.sort((a, b) => b.accepted_unix_s - a.accepted_unix_s);
    const offered = alike.slice(0, MAX_TO_COMPARE);
    const ids = offered.map(({ job_id }) => job_id).join();
    this.parts.compare.hidden = offered.length === 0;
    if (ids === this.#offered) return;
    this.#offered = ids;
    this.parts.compare.replaceChildren(
      make("option", { value: "" }, "Compare with …"),
      ...offered.map((job) => make("option", { value: job.job_id }, `${job.job_id.slice(0, 8)} ${outcome(job).word.replaceAll("_", " ")}, ${duration(seconds(job))}, ${job.client}`)),
    );
  }

  async #cancel() {
    const sure = await confirm("Cancel this job?", "A waiting job ends without a result. A running job returns its best iterate. The stream of a session ends.", "Cancel it");
    if (!sure) return;
    this.parts.cancel.disabled = true;
    this.#say("cancelling …");
    try {
      const { job } = await this.context.api.post(`/api/jobs/${this.id}/cancel`);
      const ended = toJob(job).state === "finished";
      this.#say(ended ? "cancelled" : "cancelled; it ends within one iteration");
      if (ended) this.reload();
    } catch (error) {
      this.#say(`not cancelled: ${error.message}`);
    }
    this.parts.cancel.disabled = false;
  }

  async #download(what, ending) {
    try {
      const blob = await this.context.api.blob(`/api/jobs/${this.id}/${what}`);
      const url = URL.createObjectURL(blob);
      make("a", { href: url, download: `${this.#job?.problem_name || "job"}-${this.id}.${ending}` }).click();
      setTimeout(() => URL.revokeObjectURL(url), 10000);
    } catch (error) {
      this.#say(`download failed: ${error.message}`);
    }
  }

  #say(text) {
    fill(this.parts.message, text);
  }
}
