// One line of the table of jobs. Lines are used again for other jobs as the table scrolls.

import { fill, make, plain } from "../base/dom.js";
import { age, brief, duration, gapText, jobs, ordinal, real, residual, whole } from "../base/format.js";
import { seconds, violation } from "../data/store.js";
import { outcome } from "../base/words.js";

// Of the lines of violations: powers of ten, the same in all of them, so that they can be compared.
const SPARK_LOW = -12;
const SPARK_HIGH = 2;
const TOLERANCE = -6; // the usual one

const SVG = "http://www.w3.org/2000/svg";

/** `key` names the cell's class and what a click on its head sorts by. */
export const COLUMNS = [
  { key: "status", title: "Status", hint: "What it does, or how it ended" },
  { key: "id", title: "Job", hint: "The server's id of the job" },
  { key: "name", title: "Problem", hint: "The problem's name" },
  { key: "client", title: "Client", hint: "Who sent it" },
  { key: "size", title: "n / nₑ / nᵢ / n_c", hint: "Variables, equalities, inequalities and complementarity pairs" },
  { key: "kind", title: "Kind", hint: "What it came by: solve, batch, submitted, session, scenarios, coupled or array" },
  { key: "priority", title: "Priority", hint: "Whose turn it is when workers are busy" },
  { key: "iterations", title: "Iter.", hint: "Newton iterations; of a session, of all its solves", numeric: true },
  { key: "violation", title: "Violation", hint: "Largest violation, and its course while the job runs, from 1e-12 to 100; the line is at 1e-6", numeric: true },
  { key: "proof", title: "Proof", hint: "The gap between incumbent and bound, or ✓ once it is proved, and nodes so far", numeric: true },
  { key: "queue", title: "Queue", hint: "Time spent waiting", numeric: true },
  { key: "time", title: "Time", hint: "From its acceptance to its answer", numeric: true },
  { key: "age", title: "Age", hint: "Since it was accepted", numeric: true },
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

  /** What changes by itself as time goes by. */
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
    this.#cells.status.title = waits ? `${jobs(job.queue_position)} before it, likely to wait ${duration(job.estimated_wait_s)} yet` : plain(job.error?.message || job.activity.text || job.detail);
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
