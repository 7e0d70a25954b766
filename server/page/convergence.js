// The convergence of a solve: residuals on a log scale, and objective and penalty below, by iteration or time. With a
// tree (option global_search), incumbent and bound over time.

import { make, onceAFrame, styleValue } from "./dom.js";
import { duration, rate, real, residual, whole } from "./format.js";
import { nodeRates, repeated } from "./trace.js";

const LOWEST = 1e-12; // log scales have no 0: smaller values are drawn here, the table has the numbers

const RESIDUALS = [
  { key: "equality", label: "equality violation", colour: "--blue", dash: [] },
  { key: "inequality", label: "inequality violation", colour: "--orange", dash: [6, 3] },
  { key: "complementarity", label: "complementarity violation", colour: "--green", dash: [2, 2] },
  { key: "kkt_residual", label: "KKT residual", colour: "--purple", dash: [] , width: 2.2 },
  { key: "kappa", label: "κ", colour: "--grey", dash: [8, 3, 2, 3] },
];

let library = null;

/** Chart.js, loaded when the first job is opened. */
export function loadCharts() {
  library ??= new Promise((resolve, reject) => {
    const script = make("script", { src: "/assets/chart.js" });
    script.addEventListener("load", () => resolve(globalThis.Chart));
    script.addEventListener("error", () => {
      library = null;
      reject(new Error("the chart library could not be loaded"));
    });
    document.head.append(script);
  });
  return library;
}

// Dashed lines at the visible tolerances.
const toleranceLines = {
  id: "toleranceLines",
  beforeDatasetsDraw(chart, _, { values, colour, font }) {
    const { ctx, chartArea, scales } = chart;
    for (const [value, label] of values ?? []) {
      const y = scales.y.getPixelForValue(value);
      if (!(y > chartArea.top && y < chartArea.bottom)) continue;
      ctx.save();
      ctx.strokeStyle = ctx.fillStyle = colour;
      ctx.setLineDash([3, 4]);
      ctx.beginPath();
      ctx.moveTo(chartArea.left, y);
      ctx.lineTo(chartArea.right, y);
      ctx.stroke();
      ctx.font = font;
      ctx.textAlign = "right";
      ctx.fillText(label, chartArea.right - 4, y - 4);
      ctx.restore();
    }
  },
};

function toleranceLabels(tolerances) {
  const names = new Map();
  for (const [name, value] of Object.entries(tolerances)) names.set(value, [...(names.get(value) ?? []), name]);
  if (names.size === 1) return [[[...names.keys()][0], `tolerances ${residual([...names.keys()][0])}`]];
  return [...names].map(([value, list]) => [value, `${list.join(", ")} ${residual(value)}`]);
}

export class Convergence {
  #rows = [];
  #tolerances = {};
  #alongTime = false;

  constructor(parent, Chart) {
    this.Chart = Chart;
    this.upper = make("canvas", { role: "img", id: "convergence" });
    this.lower = make("canvas", { role: "img", id: "objective-plot" });
    this.proof = make("canvas", { role: "img", id: "proof-plot" });
    this.proofPlace = make("div", { class: "chart low", hidden: true }, this.proof);
    parent.append(make("div", { class: "chart tall" }, this.upper), make("div", { class: "chart low" }, this.lower), this.proofPlace);
    this.redraw = onceAFrame(() => this.#draw());
    this.recolour = () => this.#build();
    document.addEventListener("themechange", this.recolour);
    this.#build();
  }

  show(rows, tolerances) {
    this.#rows = rows;
    this.#tolerances = tolerances;
    this.redraw();
  }
  alongTime(on) {
    this.#alongTime = on;
    this.redraw();
  }
  destroy() {
    document.removeEventListener("themechange", this.recolour);
    this.redraw.cancel();
    this.charts.forEach((chart) => chart.destroy());
  }

  #build() {
    this.charts?.forEach((chart) => chart.destroy());
    const size = parseFloat(getComputedStyle(document.documentElement).fontSize);
    this.look = { ink: styleValue("--quiet"), line: styleValue("--line"), font: { size: 0.8 * size, family: getComputedStyle(document.body).fontFamily } };
    this.charts = [this.#residualChart(), this.#objectiveChart(), this.#proofChart()];
    this.redraw();
  }

  #axis(more) {
    const { ink, line, font } = this.look;
    return {
      grid: { color: line, borderColor: line, ...more.grid },
      ...more,
      ticks: { color: ink, font, maxRotation: 0, ...more.ticks },
      title: { display: more.title !== undefined, text: more.title, color: ink, font },
    };
  }
  #logAxis(more) {
    return this.#axis({ type: "logarithmic", ...more, ticks: { maxTicksLimit: 9, callback: (value) => (Number.isInteger(Math.round(1e6 * Math.log10(value)) / 1e6) ? (value <= 1.0001 * LOWEST ? "≤ " : "") + value.toExponential(0) : null) } });
  }
  #line({ label, colour, dash = [], width = 1.5, ...more }) {
    const tint = styleValue(colour);
    return { label, data: [], borderColor: tint, backgroundColor: tint, borderWidth: width, borderDash: dash, pointRadius: 0, pointHitRadius: 6, pointStyle: "line", ...more };
  }

  #options(scales) {
    const { ink, font } = this.look;
    const head = (items) => {
      const row = this.#rows[items[0]?.dataIndex];
      return row ? `${row.isSolution ? "the solution" : `iteration ${row.iteration}`}, ${duration(row.elapsed_s)}` : "";
    };
    return {
      animation: false,
      responsive: true,
      maintainAspectRatio: false,
      parsing: false,
      normalized: true,
      interaction: { mode: "index", intersect: false },
      scales,
      plugins: {
        legend: { position: "top", align: "start", labels: { color: ink, font, usePointStyle: true, boxWidth: 28, padding: 12 } },
        tooltip: { callbacks: { title: head, label: (item) => this.#readout(item) } },
      },
    };
  }
  #readout({ dataset, raw }) {
    if (dataset.repeats) return `${raw.times} factorization${raw.times > 1 ? "s" : ""} repeated, regularization ${residual(raw.regularization)}`;
    if (dataset.yAxisID === "rate") return `${dataset.label}: ${rate(raw.value)}`;
    return `${dataset.label}: ${dataset.plain ? real(raw.value) : residual(raw.value)}`;
  }

  #residualChart() {
    const scales = { x: this.#axis({ type: "linear", ticks: { display: true } }), y: this.#logAxis({}) };
    const marks = this.#line({ label: "factorization repeated", colour: "--red", showLine: false, pointStyle: "triangle", pointRadius: 5, repeats: true });
    const options = this.#options(scales);
    options.plugins.toleranceLines = { values: [], colour: this.look.ink, font: `${this.look.font.size}px ${this.look.font.family}` };
    return new this.Chart(this.upper, { type: "line", data: { datasets: [...RESIDUALS.map((curve) => this.#line(curve)), marks] }, options, plugins: [toleranceLines] });
  }
  #objectiveChart() {
    const scales = {
      x: this.#axis({ type: "linear" }),
      y: this.#axis({ type: "linear", title: "objective", ticks: { maxTicksLimit: 4, callback: (value) => real(value) } }),
      rho: this.#logAxis({ position: "right", title: "ρ", grid: { drawOnChartArea: false } }),
    };
    const datasets = [
      this.#line({ label: "objective", colour: "--blue", plain: true }),
      this.#line({ label: "ρ", colour: "--orange", dash: [6, 3], stepped: true, yAxisID: "rho" }),
    ];
    return new this.Chart(this.lower, { type: "line", data: { datasets }, options: this.#options(scales) });
  }

  #proofChart() {
    const scales = {
      x: this.#axis({ type: "linear", title: "time since the solve began", ticks: { callback: (value) => duration(value) } }),
      y: this.#axis({ type: "linear", title: "objective", ticks: { maxTicksLimit: 4, callback: (value) => real(value) } }),
      rate: this.#axis({ type: "linear", position: "right", title: "nodes / s", grid: { drawOnChartArea: false }, min: 0, ticks: { maxTicksLimit: 4, callback: (value) => rate(value) } }),
    };
    const datasets = [
      this.#line({ label: "incumbent", colour: "--blue", width: 2.2, stepped: true, plain: true }),
      this.#line({ label: "bound", colour: "--purple", width: 2.2, stepped: true, plain: true }),
      this.#line({ label: "nodes a second", colour: "--grey", dash: [6, 3], yAxisID: "rate" }),
    ];
    return new this.Chart(this.proof, { type: "line", data: { datasets }, options: this.#options(scales) });
  }

  #drawProof() {
    const rows = this.#rows;
    const [incumbent, bound, speed] = this.charts[2].data.datasets;
    const first = rows.findIndex((row) => row.nodes > 0);
    this.proofPlace.hidden = first < 0;
    this.proof.dataset.nodes = first < 0 ? 0 : rows.at(-1).nodes;
    if (first < 0) return;
    const rates = nodeRates(rows);
    const points = (value) => rows.map((row, at) => ({ x: row.elapsed_s, y: Number.isFinite(value(row, at)) ? value(row, at) : NaN, value: value(row, at) }));
    incumbent.data = points((row) => row.incumbent);
    bound.data = points((row) => row.bound);
    speed.data = points((_, at) => rates[at]);
    Object.assign(this.charts[2].options.scales.x, { min: rows[first].elapsed_s, max: rows.at(-1).elapsed_s });
    const { incumbent: best, bound: least, gap, nodes } = rows.at(-1);
    this.proof.setAttribute("aria-label", `Incumbent ${real(best)}, bound ${real(least)}, gap ${residual(gap)} after ${whole(nodes)} nodes, ${rate(rates.at(-1))} a second.`);
    this.charts[2].update("none");
  }

  #draw() {
    const rows = this.#rows;
    const [upper, lower] = this.charts;
    const x = this.#alongTime ? (row) => row.elapsed_s : (row) => row.iteration;
    RESIDUALS.forEach(({ key }, at) => {
      upper.data.datasets[at].data = rows.map((row) => ({ x: x(row), y: this.#onLogScale(key, row), value: row[key] }));
    });
    const repeats = repeated(rows);
    upper.data.datasets.at(-1).data = rows.map((row, at) => ({
      x: x(row), y: repeats[at] > 0 ? this.#onLogScale("kkt_residual", row) : NaN, times: repeats[at], regularization: row.regularization,
    }));
    upper.options.plugins.toleranceLines.values = toleranceLabels(this.#tolerances);
    lower.data.datasets[0].data = rows.map((row) => ({ x: x(row), y: row.objective, value: row.objective }));
    lower.data.datasets[1].data = rows.map((row) => ({ x: x(row), y: row.rho > 0 ? row.rho : NaN, value: row.rho }));
    const last = rows.length > 0 ? x(rows.at(-1)) : 1;
    for (const chart of [upper, lower]) {
      Object.assign(chart.options.scales.x, { min: rows.length > 0 ? x(rows[0]) : 0, max: last });
      chart.options.scales.x.ticks.callback = this.#alongTime ? (value) => duration(value) : (value) => (Number.isInteger(value) ? value : null);
    }
    lower.options.scales.x.title = { ...lower.options.scales.x.title, display: true, text: this.#alongTime ? "time since the solve began" : "iteration" };
    this.#describe(repeats);
    for (const chart of [upper, lower]) chart.update("none");
    this.#drawProof();
  }

  // κ = 0 means no relaxation and is not drawn; a violation of 0 is drawn at the bottom.
  #onLogScale(key, row) {
    const value = row[key];
    if (!Number.isFinite(value) || (key === "kappa" && value === 0)) return NaN;
    return Math.max(value, LOWEST);
  }

  #describe(repeats) {
    const row = this.#rows.at(-1);
    const times = repeats.reduce((sum, count) => sum + count, 0);
    const text = row
      ? `Convergence over ${this.#rows.length} rows. At iteration ${row.iteration}: equality ${residual(row.equality)}, inequality ${residual(row.inequality)}, ` +
        `complementarity ${residual(row.complementarity)}, KKT residual ${residual(row.kkt_residual)}, κ ${residual(row.kappa)}. Factorizations repeated: ${times}.`
      : "Convergence: no rows yet.";
    this.upper.setAttribute("aria-label", text);
    this.upper.dataset.rows = this.#rows.length;
    this.upper.dataset.iteration = row?.iteration ?? -1;
    this.lower.setAttribute("aria-label", row ? `Objective ${real(row.objective)} and penalty ρ ${real(row.rho)} at iteration ${row.iteration}` : "Objective: no rows yet.");
  }
}
