// The jobs of the server: as many as it keeps, at most MAX_JOBS.

import { short } from "./words.js";

export const MAX_JOBS = 20000;
const SPARK_POINTS = 40;

const VIOLATIONS = /** @type {const} */ (["equality", "inequality", "complementarity"]);
const TIMES = /** @type {const} */ (["queue_s", "setup_s", "factorization_s", "line_search_s", "polish_s", "tree_s", "solve_s", "total_s"]);
const JOB_NUMBERS = /** @type {const} */ (["variables", "equalities", "inequalities", "pairs", "accepted_unix_s", "finished_unix_s", "queue_position",
  "estimated_wait_s", "iterations", "factorizations", "objective", "updates", "memory_bytes", "result_bytes"]);
const JOB_TEXTS = /** @type {const} */ (["job_id", "client", "request_id", "problem_name", "detail", "trace_id"]);
const ROW_NUMBERS = /** @type {const} */ (["iteration", "objective", "kkt_residual", "kappa", "rho", "step_length", "regularization", "factorizations", "elapsed_s"]);

/**
 * These fields of a message as numbers. protobuf's JSON leaves out zeros, and has 64-bit numbers and NaN as strings.
 * @template {string} Name @param {any} message @param {readonly Name[]} fields @returns {Record<Name, number>}
 */
export function numbers(message, fields, absent = 0) {
  return Object.assign({}, ...fields.map((field) => ({ [field]: Number(message?.[field] ?? absent) })));
}

/** @template {string} Name @param {any} message @param {readonly Name[]} fields @returns {Record<Name, string>} */
function texts(message, fields) {
  return Object.assign({}, ...fields.map((field) => ({ [field]: message[field] ?? "" })));
}

// The tree of option global_search; NaN where a number is unknown.
const toTree = (message) => ({ ...numbers(message, ["incumbent", "bound", "gap"], NaN), ...numbers(message, ["nodes", "open_nodes"]) });

/** A row of progress as one flat record, with the names of the message. */
export const toRow = (message) => ({ ...numbers(message, ROW_NUMBERS), ...numbers(message.violations, VIOLATIONS), ...toTree(message) });

/** A JobInfo as one flat record, with the names of the message; enumerations are words without their prefix. */
export function toJob(info) {
  return {
    ...numbers(info, JOB_NUMBERS),
    ...texts(info, JOB_TEXTS),
    ...numbers(info.violations, VIOLATIONS),
    ...toTree(info),
    kind: short(info.kind, "JOB_KIND_"),
    state: short(info.state, "JOB_STATE_"),
    priority: short(info.priority, "PRIORITY_"),
    status: short(info.status, "STATUS_"),
    error: Number(info.error?.code ?? 0) !== 0 ? info.error : null,
    proved: info.proved === true,
    times: numbers(info.times, TIMES),
    sample_average_stages: (info.sample_average_stages ?? []).map(toStage),
    activity: { text: info.activity?.text ?? "", ...numbers(info.activity, ["done", "total"]) },
    received: performance.now(),
    spark: null,
  };
}

function toStage(stage) {
  return {
    ...numbers(stage, ["scenarios", "objective", "factorizations", "seconds"]),
    status: short(stage.status, "STATUS_"),
    out_of_sample: stage.out_of_sample ? numbers(stage.out_of_sample, ["scenarios", "infeasible", "mean", "half_width"]) : null,
  };
}

export const violation = (job) => Math.max(job.equality, job.inequality, job.complementarity);

/** Seconds since the job's acceptance; they advance between two messages while it runs or waits. */
export function seconds(job) {
  const ages = (job.state === "running" || job.state === "queued") && job.kind !== "session";
  return job.times.total_s + (ages ? (performance.now() - job.received) / 1000 : 0);
}

/** All jobs by id. Finished jobs are removed oldest first, as on the server. */
export class Store {
  #jobs = new Map();
  #finished = []; // ids in the order of finishing; those before #head are removed
  #head = 0;
  #max = MAX_JOBS;

  /** Increases with every change. */
  version = 0;

  get size() {
    return this.#jobs.size;
  }
  get(id) {
    return this.#jobs.get(id);
  }
  all() {
    return this.#jobs.values();
  }
  /** Sets the number of finished jobs to keep. */
  keep(most) {
    this.#max = Math.min(most, MAX_JOBS);
  }

  clear() {
    this.#jobs.clear();
    this.#finished = [];
    this.#head = 0;
    ++this.version;
  }

  /** Updates a job with what a stream reports: its state and its newest rows. */
  put(info, rows = []) {
    const job = toJob(info);
    const old = this.#jobs.get(job.job_id);
    if (old?.state === "finished" && job.state !== "finished") return; // outdated
    if (job.state !== "finished") job.spark = addToSpark(old?.spark ?? [], rows);
    this.#jobs.set(job.job_id, job);
    if (job.state === "finished" && old?.state !== "finished") this.#finished.push(job.job_id);
    this.#trim();
    ++this.version;
  }

  /** Adds jobs from before the stream, newest first. Known jobs are newer and stay. */
  putHistory(infos) {
    const ids = [];
    for (const info of infos) {
      if (this.#jobs.has(info.job_id)) continue;
      const job = toJob(info);
      this.#jobs.set(job.job_id, job);
      if (job.state === "finished") ids.push(job.job_id);
    }
    const finishedAt = (id) => this.#jobs.get(id).finished_unix_s;
    this.#finished = [...ids, ...this.#finished.slice(this.#head).filter((id) => this.#jobs.has(id))];
    this.#finished.sort((a, b) => finishedAt(a) - finishedAt(b));
    this.#head = 0;
    this.#trim();
    ++this.version;
  }

  remove(id) {
    if (this.#jobs.delete(id)) ++this.version;
  }

  #trim() {
    while (this.#finished.length - this.#head > this.#max) this.#jobs.delete(this.#finished[this.#head++]);
    if (this.#head > 1000 && this.#head > this.#finished.length / 2) {
      this.#finished = this.#finished.slice(this.#head);
      this.#head = 0;
    }
  }
}

// The logarithm of the largest violation of the newest rows, oldest first.
function addToSpark(spark, rows) {
  for (const row of rows) {
    spark.push(Math.log10(Math.max(violation(toRow(row)), 1e-16)));
  }
  if (spark.length > SPARK_POINTS) spark.splice(0, spark.length - SPARK_POINTS);
  return spark;
}
