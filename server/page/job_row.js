// One row of the table of jobs. Rows are reused for other jobs as the table scrolls.

import { fill, make, plain } from "./dom.js";
import { age, brief, duration, gapText, jobs, ordinal, real, residual, whole } from "./format.js";
import { seconds, violation } from "./store.js";
import { outcome } from "./words.js";

// The range of the violation curves, in powers of ten; the same in all rows.
const SPARK_LOW = -12;
const SPARK_HIGH = 2;
const TOLERANCE = -6; // the default

const SVG = "http://www.w3.org/2000/svg";

/** `key` is the class of the cells and the key for sorting. */
export const COLUMNS = [
  { key: "status", title: "Status", hint: "State, or status after the end" },
  { key: "id", title: "Job", hint: "Id of the job on the server" },
  { key: "name", title: "Problem", hint: "The problem's name" },
  { key: "client", title: "Client", hint: "The client that sent the job" },
  { key: "size", title: "n / nₑ / nᵢ / n_c", hint: "Variables, equalities, inequalities and complementarity pairs" },
  { key: "kind", title: "Kind", hint: "Kind of call: solve, batch, submitted, session, scenarios, coupled or array" },
  { key: "priority", title: "Priority", hint: "Order in which busy workers take jobs" },
  { key: "iterations", title: "Iter.", hint: "Newton iterations; for a session, of all its solves", numeric: true },
  { key: "violation", title: "Violation", hint: "Largest violation, with its curve from 1e-12 to 100 while the job runs; the line is at 1e-6", numeric: true },
  { key: "proof", title: "Proof", hint: "Gap between incumbent and bound, or ✓ if proved, and number of nodes", numeric: true },
  { key: "queue", title: "Queue", hint: "Time spent waiting", numeric: true },
  { key: "time", title: "Time", hint: "From acceptance to result", numeric: true },
  { key: "age", title: "Age", hint: "Time since acceptance", numeric: true },
];

const sparkHeight = (power) => (15 - (14 * (Math.min(SPARK_HIGH, Math.max(SPARK_LOW, power)) - SPARK_LOW)) / (SPARK_HIGH - SPARK_LOW)).toFixed(1);

export class JobRow {
  #cells = {};
  job = null;

  constructor(number) {
    const cells = COLUMNS.map(({ key, numeric }, column) => {
      const cell = make("div", { role: "gridcell", class: `${key}${numeric ? " numeric" : ""}`, "aria-colindex": column + 1 });
      return (this.#cells[key] = cell);
    });
    this.sign = make("span", { class: "sign", "aria-hidden": "true" });
    this.word = make("span");
    this.#cells.status.append(this.sign, this.word);
    this.link = make("a", { tabindex: "-1" });
    this.#cells.id.append(this.link);
    this.spark = document.createElementNS(SVG, "svg");
    this.spark.setAttribute("viewBox", "0 0 40 16");
    this.spark.setAttribute("preserveAspectRatio", "none");
    this.spark.setAttribute("aria-hidden", "true");
    this.path = document.createElementNS(SVG, "path");
    const level = document.createElementNS(SVG, "path");
    level.setAttribute("class", "level");
    level.setAttribute("d", `M0 ${sparkHeight(TOLERANCE)}H40`);
    this.spark.append(this.path, level);
    this.last = make("span");
    this.#cells.violation.append(this.spark, this.last);
    this.element = make("div", { role: "row", class: "job-row", id: `row-${number}` }, ...cells);
  }

  show(job, index, top, chosen) {
    this.job = job;
    const element = this.element;
    element.hidden = false;
    element.style.transform = `translateY(${top}px)`;
    element.setAttribute("aria-rowindex", index + 2);
    element.setAttribute("aria-selected", chosen ? "true" : "false");
    element.dataset.job = job.job_id;
    this.#showOutcome(job);
    fill(this.link, job.job_id.slice(0, 8));
    this.link.href = `#/jobs/${job.job_id}`;
    this.link.title = job.job_id;
    this.#text("name", job.problem_name || "–", job.problem_name);
    this.#text("client", job.client, job.client);
    const size = `${whole(job.variables)} / ${whole(job.equalities)} / ${whole(job.inequalities)} / ${whole(job.pairs)}`;
    this.#text("size", size, size);
    this.#text("kind", job.kind);
    this.#text("priority", job.priority);
    this.#text("iterations", job.state === "queued" ? "–" : whole(job.iterations));
    this.#showViolation(job);
    this.#showProof(job);
    this.#text("queue", duration(job.times.queue_s));
    this.tick();
  }

  /** Updates the cells that change with time. */
  tick() {
    this.#text("time", duration(seconds(this.job)));
    this.#text("age", age(Date.now() / 1000 - this.job.accepted_unix_s));
  }

  hide() {
    this.element.hidden = true;
    this.job = null;
    delete this.element.dataset.job;
  }

  #text(key, text, title) {
    fill(this.#cells[key], text);
    if (title !== undefined) this.#cells[key].title = plain(title);
  }

  #showOutcome(job) {
    const { word, tone, sign } = outcome(job);
    const waits = job.state === "queued" && job.queue_position >= 0;
    const part = job.state === "running" && job.activity.total > 0 ? ` · ${whole(job.activity.done)}/${whole(job.activity.total)}` : "";
    fill(this.word, word.replaceAll("_", " ") + (waits ? ` · ${ordinal(job.queue_position + 1)}` : part));
    fill(this.sign, sign);
    this.#cells.status.dataset.tone = tone;
    this.#cells.status.title = waits ? `${jobs(job.queue_position)} before it, estimated wait ${duration(job.estimated_wait_s)}` : plain(job.error?.message || job.activity.text || job.detail);
  }

  #showProof({ nodes, open_nodes, gap, incumbent, bound, proved }) {
    const known = nodes > 0;
    const text = proved ? "✓" : Number.isFinite(gap) ? `${gapText(gap)} ·` : "no gap ·";
    const best = Number.isFinite(incumbent) ? real(incumbent) : "none yet";
    const least = Number.isFinite(bound) ? real(bound) : "none yet";
    this.#text("proof", known ? `${text} ${brief(nodes)} ${nodes === 1 ? "node" : "nodes"}` : "", known ? `Incumbent ${best}, bound ${least}, gap ${Number.isFinite(gap) ? residual(gap) : "unknown"}; ${whole(nodes)} nodes, ${whole(open_nodes)} open` : "");
  }

  #showViolation(job) {
    const known = job.iterations > 0 || job.state === "finished";
    fill(this.last, known && !job.error ? residual(violation(job)) : "–");
    const points = job.spark ?? [];
    const drawn = points.length > 1;
    this.spark.style.display = drawn ? "" : "none";
    if (!drawn) return;
    const place = (value, at) => `${((40 * at) / (points.length - 1)).toFixed(1)} ${sparkHeight(value)}`;
    this.path.setAttribute("d", `M${points.map(place).join("L")}`);
  }
}
