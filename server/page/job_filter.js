// Filtering and sorting of jobs, as pure functions.

import { statuses } from "./shared/tables.js";
import { outcome } from "./words.js";
import { seconds, violation } from "./store.js";

const RANKS = { running: 0, queued: 1, idle: 2, finished: 3 };
const PRIORITY_RANKS = { realtime: 0, interactive: 1, batch: 2 };
const STATUS_RANKS = Object.keys(statuses);

/** Chips by group. A job must match one of the active chips of each group that has any. */
export const CHIPS = [
  { group: "state", name: "running", holds: (job) => job.state === "running" },
  { group: "state", name: "queued", holds: (job) => job.state === "queued" },
  { group: "state", name: "idle", holds: (job) => job.state === "idle" },
  { group: "state", name: "solved", holds: (job) => job.state === "finished" && outcome(job).tone === "good" },
  { group: "state", name: "not solved", holds: (job) => job.state === "finished" && outcome(job).tone !== "good" },
  { group: "priority", name: "realtime", holds: (job) => job.priority === "realtime" },
  { group: "priority", name: "interactive", holds: (job) => job.priority === "interactive" },
  { group: "priority", name: "batch", holds: (job) => job.priority === "batch" },
];

/** Sort keys of the columns. The default order is running, waiting, then newest jobs. */
const KEYS = {
  status: (job) => 100 * RANKS[job.state] + (job.error ? 50 : STATUS_RANKS.indexOf(job.status)),
  id: (job) => job.job_id,
  name: (job) => job.problem_name,
  client: (job) => job.client,
  size: (job) => job.variables,
  kind: (job) => job.kind,
  priority: (job) => PRIORITY_RANKS[job.priority] ?? 3,
  iterations: (job) => job.iterations,
  violation,
  proof: (job) => (job.nodes === 0 ? -1 : job.proved ? 0 : Number.isFinite(job.gap) ? job.gap : Infinity),
  time: seconds,
  queue: (job) => job.times.queue_s,
  age: (job) => job.accepted_unix_s,
};

const newestFirst = (a, b) => b.accepted_unix_s - a.accepted_unix_s || (a.job_id < b.job_id ? -1 : 1);
const activity = (a, b) => RANKS[a.state] - RANKS[b.state] || newestFirst(a, b);

/** Whether every word of the filter occurs in one of these fields. */
function matches(job, words) {
  if (words.length === 0) return true;
  const text = `${job.job_id} ${job.client} ${job.problem_name} ${job.request_id} ${outcome(job).word} ${job.kind}`.toLowerCase();
  return words.every((word) => text.includes(word));
}

/**
 * Filters and sorts jobs. `chips` is a set of names; `sort` is {column, down}, with column "" for the default order.
 */
export function select(jobs, text, chips, sort) {
  const words = text.toLowerCase().split(/\s+/).filter((word) => word !== "");
  const on = CHIPS.filter((chip) => chips.has(chip.name));
  const groups = [...new Set(on.map((chip) => chip.group))].map((group) => on.filter((chip) => chip.group === group));
  const chosen = [];
  for (const job of jobs) {
    if (groups.every((group) => group.some((chip) => chip.holds(job))) && matches(job, words)) chosen.push(job);
  }
  return chosen.sort(order(sort));
}

function order({ column, down }) {
  const key = KEYS[column];
  if (!key) return activity;
  const sign = down ? -1 : 1;
  return (a, b) => {
    const left = key(a);
    const right = key(b);
    return left < right ? -sign : left > right ? sign : newestFirst(a, b);
  };
}
