// What the page knows of the server's jobs: bounded by what the server keeps, and by MOST_JOBS.

import { short } from "../base/words.js";

export const MOST_JOBS = 20000;
const SPARK_POINTS = 40;

/** A number of protobuf's JSON: 64-bit ones and NaN come as strings. */
export const number = (value) => (value === undefined || value === null ? 0 : Number(value));

const known = (value) => (value === undefined || value === null ? NaN : Number(value));

/** What a JobInfo or a row tells of the tree of option global; NaN where it is not known. */
export const toTree = (message) => ({
  incumbent: known(message.incumbent),
  bound: known(message.bound),
  gap: known(message.gap),
  nodes: number(message.nodes),
  openNodes: number(message.open_nodes),
});

/** A JobInfo as one flat record; what a table shows and sorts by. */
export function toJob(info) {
  const violations = info.violations ?? {};
  return {
    id: info.job_id,
    kind: short(info.kind, "JOB_KIND_"),
    state: short(info.state, "JOB_STATE_"),
    priority: short(info.priority, "PRIORITY_"),
    client: info.client ?? "",
    requestId: info.request_id ?? "",
    name: info.problem_name ?? "",
    n: number(info.variables),
    ne: number(info.equalities),
    ni: number(info.inequalities),
    nc: number(info.pairs),
    accepted: number(info.accepted_unix_s),
    finished: number(info.finished_unix_s),
    position: number(info.queue_position),
    wait_s: number(info.estimated_wait_s),
    status: short(info.status, "STATUS_"),
    error: info.error && number(info.error.code) !== 0 ? info.error : null,
    iterations: number(info.iterations),
    factorizations: number(info.factorizations),
    objective: number(info.objective),
    equality: number(violations.equality),
    inequality: number(violations.inequality),
    complementarity: number(violations.complementarity),
    ...toTree(info),
    proved: info.proved === true,
    levels: (info.scenario_levels ?? []).map(toLevel),
    times: toTimes(info.times ?? {}),
    updates: number(info.updates),
    memory: number(info.memory_bytes),
    resultBytes: number(info.result_bytes),
    activity: info.activity?.text ?? "",
    done: number(info.activity?.done),
    of: number(info.activity?.total),
    detail: info.detail ?? "",
    traceId: info.trace_id ?? "",
    told: performance.now(),
    spark: null,
  };
}

/** A level of a scenario solve. */
function toLevel({ scenarios, status, objective, factorizations, seconds: took, fresh }) {
  return {
    scenarios: number(scenarios),
    status: short(status, "STATUS_"),
    objective: number(objective),
    factorizations: number(factorizations),
    seconds: number(took),
    fresh: fresh ? { scenarios: number(fresh.scenarios), without: number(fresh.without_recourse), mean: number(fresh.mean), half: number(fresh.half_width) } : null,
  };
}

function toTimes(times) {
  const parts = ["queue", "setup", "factorization", "line_search", "polish", "tree", "solve", "total"];
  return Object.fromEntries(parts.map((part) => [part, number(times[`${part}_s`])]));
}

export const violation = (job) => Math.max(job.equality, job.inequality, job.complementarity);

/** Seconds since it came; of what runs or waits they go on between two messages. */
export function seconds(job) {
  const ages = (job.state === "running" || job.state === "queued") && job.kind !== "session";
  return job.times.total + (ages ? (performance.now() - job.told) / 1000 : 0);
}

/** All jobs by id. What has finished is forgotten oldest first, as the server does. */
export class Store {
  #jobs = new Map();
  #finished = []; // ids in the order of finishing; those before #head are forgotten
  #head = 0;
  #most = MOST_JOBS;

  /** Grows with every change of any job. */
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
  /** How many finished jobs are kept, as the server keeps them and this page can. */
  keep(most) {
    this.#most = Math.min(most, MOST_JOBS);
  }

  clear() {
    this.#jobs.clear();
    this.#finished = [];
    this.#head = 0;
    ++this.version;
  }

  /** Takes in what a stream told: the job as it is, and its newest rows. */
  put(info, rows = []) {
    const job = toJob(info);
    const old = this.#jobs.get(job.id);
    if (old?.state === "finished" && job.state !== "finished") return; // older news
    if (job.state !== "finished") job.spark = addToSpark(old?.spark ?? [], rows);
    this.#jobs.set(job.id, job);
    if (job.state === "finished" && old?.state !== "finished") this.#finished.push(job.id);
    this.#forget();
    ++this.version;
  }

  /** Takes in finished jobs of before the stream began, newest first. What is known already is newer. */
  putHistory(infos) {
    const ids = [];
    for (const info of infos) {
      if (this.#jobs.has(info.job_id)) continue;
      const job = toJob(info);
      this.#jobs.set(job.id, job);
      if (job.state === "finished") ids.push(job.id);
    }
    const finishedAt = (id) => this.#jobs.get(id).finished;
    this.#finished = [...ids, ...this.#finished.slice(this.#head).filter((id) => this.#jobs.has(id))];
    this.#finished.sort((a, b) => finishedAt(a) - finishedAt(b));
    this.#head = 0;
    this.#forget();
    ++this.version;
  }

  remove(id) {
    if (this.#jobs.delete(id)) ++this.version;
  }

  #forget() {
    while (this.#finished.length - this.#head > this.#most) this.#jobs.delete(this.#finished[this.#head++]);
    if (this.#head > 1000 && this.#head > this.#finished.length / 2) {
      this.#finished = this.#finished.slice(this.#head);
      this.#head = 0;
    }
  }
}

// The logarithm of the largest violation of the newest rows, oldest first.
function addToSpark(spark, rows) {
  for (const row of rows) {
    const { equality, inequality, complementarity } = row.violations ?? {};
    const largest = Math.max(number(equality), number(inequality), number(complementarity));
    spark.push(Math.log10(Math.max(largest, 1e-16)));
  }
  if (spark.length > SPARK_POINTS) spark.splice(0, spark.length - SPARK_POINTS);
  return spark;
}
