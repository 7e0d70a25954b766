// Compares two jobs: results and times, different options, and convergence.

import { loadCharts } from "./convergence.js";
import { make, styleValue } from "./dom.js";
import { duration, real, residual, whole } from "./format.js";
import { toJob, violation } from "./store.js";
import { Trace } from "./trace.js";
import { outcome } from "./words.js";

const LOWEST = 1e-12;
const LOOKS = [{ colour: "--blue", dash: [] }, { colour: "--orange", dash: [6, 3] }];

// `size`: a number whose ratio is shown.
const FACTS = [
  { name: "Status", text: (job) => outcome(job).word.replaceAll("_", " ") },
  { name: "Client", text: (job) => job.client },
  { name: "n / nₑ / nᵢ / n_c", text: (job) => [job.variables, job.equalities, job.inequalities, job.pairs].map(whole).join(" / ") },
  { name: "Objective", text: (job) => (job.error || job.iterations === 0 ? "–" : real(job.objective)) },
  { name: "Largest violation", text: (job) => (job.error ? "–" : residual(violation(job))) },
  { name: "Iterations", text: (job) => whole(job.iterations), size: (job) => job.iterations },
  { name: "Factorizations", text: (job) => whole(job.factorizations), size: (job) => job.factorizations },
  { name: "Nodes", text: (job) => (job.nodes > 0 ? whole(job.nodes) : "–"), size: (job) => job.nodes },
  { name: "Gap", text: (job) => (job.nodes > 0 && Number.isFinite(job.gap) ? residual(job.gap) : "–") },
  { name: "In the queue", text: (job) => duration(job.times.queue_s), size: (job) => job.times.queue_s },
  { name: "Set-up", text: (job) => duration(job.times.setup_s), size: (job) => job.times.setup_s },
  { name: "Solve", text: (job) => duration(job.times.solve_s), size: (job) => job.times.solve_s },
];

function ratio(first, second) {
  return first > 0 && second > 0 ? `${Number((second / first).toPrecision(3))} ×` : "";
}

// The solution was polished after the last row.
function withSolution(job, rows) {
  if (job.state !== "finished" || job.error || rows.length === 0) return rows;
  return [...rows, { elapsed_s: Math.max(rows.at(-1).elapsed_s, job.times.solve_s), worst: violation(job) }];
}

export class Comparison {
  #closed = false;
  chart = null;

  /** `ids` of two jobs; `context` as for a JobView. */
  constructor(place, ids, context) {
    this.place = place;
    this.ids = ids;
    this.context = context;
    this.#load();
  }

  close() {
    this.#closed = true;
    this.chart?.destroy();
  }
  reload() {
    this.#load();
  }
  /** Does nothing: the comparison does not depend on the server's state. */
  update() {}

  async #load() {
    try {
      const answers = await Promise.all(this.ids.map((id) => this.context.api.get(`/api/jobs/${id}`)));
      if (this.#closed) return;
      this.#show(answers.map(({ job, options, trace }) => {
        const rows = new Trace();
        rows.replace(trace);
        return { job: toJob(job), options: options ?? {}, rows: rows.rows.map((row) => ({ elapsed_s: row.elapsed_s, worst: violation(row) })) };
      }));
    } catch (error) {
      if (this.#closed || error.status === 401) return;
      const why = error.status === 404 ? "The server does not know one of these jobs." : error.message;
      this.place.replaceChildren(make("div", { class: "why", id: "why" }, make("p", {}, why)), make("a", { href: "#/" }, "All jobs"));
    }
  }

  async #show(both) {
    const canvas = make("canvas", { role: "img", id: "comparison-plot", "aria-label": "Largest violation of both jobs over time" });
    this.place.replaceChildren(
      make(
        "article",
        { class: "comparison" },
        make("div", { class: "job-top" }, make("a", { href: "#/", class: "back" }, make("span", { "aria-hidden": "true" }, "← "), "Jobs"), make("h2", { tabindex: "-1" }, "Two jobs")),
        make("section", { class: "card" }, make("h3", {}, "Results"), this.#facts(both)),
        make("section", { class: "card plot-panel" }, make("h3", {}, "Largest violation over time"), make("div", { class: "chart tall" }, canvas)),
        make("section", { class: "card" }, make("h3", {}, "Options that differ"), this.#options(both)),
      ),
    );
    const Chart = await loadCharts();
    if (!this.#closed && canvas.isConnected) this.#draw(Chart, canvas, both);
  }

  #table(caption, head, rows) {
    const cells = ([name, ...texts]) => make("tr", {}, make("th", { scope: "row" }, name), ...texts.map((text) => make("td", {}, text)));
    return make("table", { class: "numbers" }, make("caption", { class: "visually-hidden" }, caption), make("thead", {}, make("tr", {}, ...head.map((text) => make("th", { scope: "col" }, text)))), make("tbody", {}, ...rows.map(cells)));
  }

  #links(both) {
    return both.map(({ job }) => make("a", { href: `#/jobs/${job.job_id}` }, `${job.problem_name || "job"} ${job.job_id.slice(0, 8)}`));
  }

  #facts(both) {
    const [first, second] = both.map(({ job }) => job);
    const rows = FACTS.map(({ name, text, size }) => [name, text(first), text(second), size ? ratio(size(first), size(second)) : ""]);
    return this.#table("Both jobs", ["fact", ...this.#links(both), "second / first"], rows);
  }

  #options(both) {
    const names = [...new Set(both.flatMap(({ options }) => Object.keys(options)))].sort();
    const text = (value) => (value === undefined ? "–" : typeof value === "number" ? real(value) : String(value));
    const rows = names.map((name) => [name, ...both.map(({ options }) => text(options[name]))]).filter(([, first, second]) => first !== second);
    return rows.length > 0 ? this.#table("Options", ["option", ...this.#links(both)], rows) : make("p", { class: "empty" }, "None: both were solved with the same options.");
  }

  #draw(Chart, canvas, both) {
    const ink = styleValue("--quiet");
    const font = { size: 0.8 * parseFloat(getComputedStyle(document.documentElement).fontSize), family: getComputedStyle(document.body).fontFamily };
    const axis = (more) => ({ grid: { color: styleValue("--line"), borderColor: styleValue("--line") }, ...more, ticks: { color: ink, font, maxRotation: 0, ...more.ticks } });
    const datasets = both.map(({ job, rows }, at) => ({
      label: `${job.problem_name || "job"} ${job.job_id.slice(0, 8)}`,
      data: withSolution(job, rows).map(({ elapsed_s, worst }) => ({ x: elapsed_s, y: Math.max(LOWEST, worst) })),
      borderColor: styleValue(LOOKS[at].colour), backgroundColor: styleValue(LOOKS[at].colour), borderDash: LOOKS[at].dash, borderWidth: 1.5, pointRadius: 0, pointStyle: "line",
    }));
    this.chart = new Chart(canvas, {
      type: "line",
      data: { datasets },
      options: {
        animation: false, responsive: true, maintainAspectRatio: false, parsing: false, normalized: true,
        scales: {
          x: axis({ type: "linear", min: 0, ticks: { callback: (value) => duration(value) } }),
          y: axis({ type: "logarithmic", ticks: { maxTicksLimit: 9, callback: (value) => (Number.isInteger(Math.round(1e6 * Math.log10(value)) / 1e6) ? value.toExponential(0) : null) } }),
        },
        plugins: { legend: { position: "top", align: "start", labels: { color: ink, font, usePointStyle: true, boxWidth: 28 } } },
      },
    });
  }
}
