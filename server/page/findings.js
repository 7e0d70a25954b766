// Explains in sentences why a job failed or was slow.

import { duration, percent, real, residual, whole } from "./format.js";
import { seconds } from "./store.js";
import { partsOf } from "./timings.js";
import { repeated } from "./trace.js";
import { statuses } from "./shared/tables.js";
import { STATES, errorWords, short } from "./words.js";
import { isBudgetSpent, kindText, whatToTry } from "./shared/solution-kind.js";

const VIOLATIONS = [
  ["equality", "equality_tolerance", "|A z + b|"],
  ["inequality", "inequality_tolerance", "−(C z + d)"],
  ["complementarity", "complementarity_tolerance", "|min(s, t)|"],
];

/** Each violation with its tolerance. `name`, `value`, `tolerance`, `meaning`, `met`. */
export function judge(job, options) {
  return VIOLATIONS.map(([name, option, meaning]) => {
    const tolerance = Number(options?.[option] ?? NaN);
    return { name, value: job[name], tolerance, meaning, met: job[name] <= tolerance };
  });
}

/** The summary of a job: {tone, title, lines}. `solution` is the stored solution, if the server has one. */
export function explain(job, options, rows, solution = null) {
  const lines = [];
  if (job.error) {
    const { name, means, advice } = errorWords(job.error.code);
    lines.push(means, ...errorDetails(job.error));
    if (advice) lines.push(`What to try: ${advice}`);
    return { tone: "bad", title: `Failed: ${name.replaceAll("_", " ")}`, lines };
  }
  const known = statuses[job.status];
  if (job.state !== "finished") lines.push(...underWay(job, options));
  if (known) {
    lines.push(known.means);
    if (job.detail) lines.push(`Detail: ${job.detail}.`);
    if (known.tone !== "good" && job.state === "finished") lines.push(...unmet(job, options));
    lines.push(...kindOfSolution(job, options, solution));
  }
  lines.push(...proof(job));
  lines.push(...slow(job, rows));
  const word = job.state === "finished" ? job.status || "ended" : job.state;
  return { tone: job.state === "finished" ? (known?.tone ?? "quiet") : job.state, title: word.replaceAll("_", " "), lines };
}

// A JobInfo contains only `proved`; stationarity and second-order tests are part of the solution.
function kindOfSolution(job, options, solution) {
  if (job.state !== "finished" || job.sample_average_stages.length > 0) return [];
  const untested = solution === null && job.status === "solved" && !job.proved;
  const { max_local_search_factorizations: maxLocalSearchFactorizations, num_starts: numStarts, effort } = options ?? {};
  const facts = {
    ...job,
    bStationary: solution?.b_stationary,
    secondOrder: untested ? "minimum" : short(solution?.second_order, "SECOND_ORDER_"),
    feasible: judge(job, options).every(({ met }) => met),
    pairs: job.pairs,
    budgetSpent: isBudgetSpent(job, { maxLocalSearchFactorizations, numStarts, effort }),
    starts: numStarts ?? 1,
    globalSearch: options?.global_search === true,
  };
  const shown = job.proved && job.nodes > 0; // by `proof`
  const kind = untested ? "It is not proved that this is the optimum." : `Kind: ${kindText(facts)}.`;
  const advice = whatToTry(facts);
  return [...(shown ? [] : [kind]), ...(advice ? [`What to try: ${advice}`] : [])];
}

function underWay(job, options) {
  const lines = [STATES[job.state] ?? ""];
  if (job.state === "queued") lines.push(`${whole(job.queue_position)} before it; estimated wait ${duration(job.estimated_wait_s)}.`);
  if (job.state !== "running" || job.kind === "session") return lines;
  if (job.activity.text) lines.push(`Now: ${job.activity.text}.`);
  if (options?.global_search === true && job.nodes === 0) lines.push("It searches for a first good point; then the tree begins, which yields a bound.");
  return lines;
}

/** The used part of a running job's time limit, {used, limit} in seconds; null without a limit. */
export function timeLimit(job, options) {
  const limit = Number(options?.time_limit_s ?? Infinity);
  if (job.state !== "running" || job.kind === "session" || !(limit < 1e8)) return null;
  return { used: Math.min(limit, Math.max(0, seconds(job) - job.times.queue_s)), limit };
}

// The message contains field, index and rule.
function errorDetails(error) {
  const delay = (error.details ?? []).map((detail) => detail.retryDelay ?? detail.retry_delay).find(Boolean);
  return delay ? [error.message, `The server recommends a retry after ${delay}.`] : [error.message];
}

function unmet(job, options) {
  const broken = judge(job, options).filter(({ met, tolerance }) => !met && Number.isFinite(tolerance));
  if (broken.length === 0) return [];
  const texts = broken.map(({ name, value, tolerance, meaning }) => `${name} ${meaning} = ${residual(value)}, tolerance ${residual(tolerance)}`);
  return [`Not met: ${texts.join("; ")}.`];
}

const PARTS = [["equality", "equalities"], ["inequality", "inequalities"], ["left side of pair", "pairs"], ["right side of pair", "pairs"]];

// The name of a row by its position in a certificate: the multipliers of A z + b, C z + d, L z + l and R z + r.
function rowName(job, position) {
  let first = 0;
  for (const [name, count] of PARTS) {
    if (position < first + job[count]) return `${name} ${position - first}`;
    first += job[count];
  }
  return `row ${position}`;
}

/** The rows with the largest multipliers in an infeasibility certificate, as {row, multiplier}, and the number of more. */
export function conflictingRows(job, { rows, multipliers, more_rows }) {
  const shown = (rows ?? []).map((position, at) => ({ row: rowName(job, position), multiplier: Number(multipliers[at]) }));
  return { rows: shown, more: Number(more_rows ?? 0) };
}

const CONFLICT_PARTS = [
  ["equality", "equalities", "A z + b = 0"],
  ["inequality", "inequalities", "C z + d ≥ 0"],
  ["left side of pair", "left_sides", "L z + l ≥ 0"],
  ["right side of pair", "right_sides", "R z + r ≥ 0"],
  ["complementarity of pair", "complementarities", "L z + l = 0 or R z + r = 0"],
];

/** The parts of a conflict as {part, needs}, the number of further parts, and whether it is minimal. It may be absent. */
export function conflictingParts({ conflict, more_parts }) {
  const parts = CONFLICT_PARTS.flatMap(([name, field, needs]) => (conflict?.[field] ?? []).map((row) => ({ part: `${name} ${row}`, needs })));
  return { parts, more: Number(more_parts ?? 0), minimal: conflict?.minimal === true, detail: conflict?.detail ?? "" };
}

// What the tree of option global_search has proved.
function proof({ nodes, open_nodes, state, status, proved, incumbent, bound, gap }) {
  if (nodes === 0) return [];
  const count = `${whole(nodes)} ${nodes === 1 ? "node" : "nodes"}`;
  if (proved) return [status === "infeasible" ? `Proved infeasible: ${count}.` : `Proved optimal: gap ${residual(gap)}, ${count}.`];
  const best = Number.isFinite(incumbent) ? `The best point has objective ${real(incumbent)}` : "No feasible point is known";
  const least = Number.isFinite(bound) ? `the lower bound is ${real(bound)}` : "no lower bound is known";
  const distance = Number.isFinite(gap) ? `; gap ${residual(gap)}` : "";
  return [`Not proved${state === "finished" ? "" : " yet"}. ${best}, ${least}${distance}. ${count}, ${whole(open_nodes)} open.`];
}

// The part that took most of the time, if any.
function slow(job, rows) {
  const lines = [];
  const total = seconds(job);
  if (job.times.queue_s > 0.5 * total && job.times.queue_s > 0.01) {
    lines.push(`Most of the time it waited in the queue: ${duration(job.times.queue_s)} of ${duration(total)}.`);
  } else if (job.times.solve_s > 0) {
    const [name, longest] = partsOf(job.times).reduce((a, b) => (b[1] > a[1] ? b : a));
    if (longest > 0.5 * total) lines.push(`Most of the time was spent on ${name}: ${duration(longest)}, ${percent(longest / total)} of the total.`);
  }
  const again = repeated(rows).reduce((sum, count) => sum + count, 0);
  if (again > 0) lines.push(`${whole(again)} ${again === 1 ? "factorization was" : "factorizations were"} repeated because regularization had to be raised (marked in the plot).`);
  return lines;
}
