// One line of the table of jobs. Lines are used again for other jobs as the table scrolls.

import { fill, make, plain } from "../base/dom.js";
import { age, duration, residual, whole } from "../base/format.js";
import { seconds, violation } from "../data/store.js";
import { outcome } from "../base/words.js";

const SVG = "http://www.w3.org/2000/svg";

/** `key` names the cell's class and what a click on its head sorts by. */
export const COLUMNS = [
  { key: "status", title: "Status", hint: "What it does, or how it ended" },
  { key: "id", title: "Job", hint: "The server's id of the job" },
  { key: "name", title: "Problem", hint: "The problem's name" },
  { key: "client", title: "Client", hint: "Who sent it" },
  { key: "size", title: "n / nₑ / nᵢ / n_c", hint: "Variables, equalities, inequalities and complementarity pairs" },
  { key: "kind", title: "Kind", hint: "What it came by: solve, batch, submitted, session, scenarios or coupled" },
  { key: "priority", title: "Priority", hint: "Whose turn it is when workers are busy" },
  { key: "iterations", title: "Iter.", hint: "Newton iterations; of a session, of all its solves", numeric: true },
  { key: "violation", title: "Violation", hint: "Largest violation, and its course while the job runs", numeric: true },
  { key: "queue", title: "Queue", hint: "Time spent waiting", numeric: true },
  { key: "time", title: "Time", hint: "From its acceptance to its answer", numeric: true },
  { key: "age", title: "Age", hint: "Since it was accepted", numeric: true },
];

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
    this.spark.append(this.path);
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
    element.dataset.job = job.id;
    this.#showOutcome(job);
    fill(this.link, job.id.slice(0, 8));
    this.link.href = `#/jobs/${job.id}`;
    this.link.title = job.id;
    this.#text("name", job.name || "–", job.name);
    this.#text("client", job.client, job.client);
    const size = `${whole(job.n)} / ${whole(job.ne)} / ${whole(job.ni)} / ${whole(job.nc)}`;
    this.#text("size", size, size);
    this.#text("kind", job.kind);
    this.#text("priority", job.priority);
    this.#text("iterations", job.state === "queued" ? "–" : whole(job.iterations));
    this.#showViolation(job);
    this.#text("queue", duration(job.times.queue));
    this.tick();
  }

  /** What changes by itself as time goes by. */
  tick() {
    this.#text("time", duration(seconds(this.job)));
    this.#text("age", age(Date.now() / 1000 - this.job.accepted));
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
    const place = job.state === "queued" && job.position >= 0 ? ` · ${whole(job.position)} ahead` : "";
    fill(this.word, word.replaceAll("_", " ") + place);
    fill(this.sign, sign);
    this.#cells.status.dataset.tone = tone;
    this.#cells.status.title = plain(job.error?.message || job.detail);
  }

  #showViolation(job) {
    const known = job.iterations > 0 || job.state === "finished";
    fill(this.last, known && !job.error ? residual(violation(job)) : "–");
    const points = job.spark ?? [];
    const drawn = points.length > 1;
    this.spark.style.display = drawn ? "" : "none";
    if (!drawn) return;
    const low = Math.min(...points, -6);
    const high = Math.max(...points, low + 1);
    const place = (value, at) => `${((40 * at) / (points.length - 1)).toFixed(1)} ${(15 - (14 * (value - low)) / (high - low)).toFixed(1)}`;
    this.path.setAttribute("d", `M${points.map(place).join("L")}`);
  }
}
