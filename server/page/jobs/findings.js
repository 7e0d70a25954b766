// Why a job failed or was slow, in sentences, from what is known of it.

import { duration, percent, real, residual, whole } from "../base/format.js";
import { seconds } from "../data/store.js";
import { partsOf } from "../plots/timings.js";
import { repeated } from "../data/trace.js";
import { STATUSES } from "../base/tables.js";
import { STATES, errorWords, short } from "../base/words.js";
import { kindText, whatToTry } from "./answer.js";

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

/** The sentences on top of a job: {tone, title, lines}. `solution` is what the server has kept of its answer, if anything. */
export function explain(job, options, rows, solution = null) {
  const lines = [];
  if (job.error) {
    const { name, means, advice } = errorWords(job.error.code);
    lines.push(means, ...errorDetails(job.error));
    if (advice) lines.push(`What to try: ${advice}`);
    return { tone: "bad", title: `No answer: ${name.replaceAll("_", " ")}`, lines };
  }
  const known = STATUSES[job.status];
  if (job.state !== "finished") lines.push(...underWay(job, options));
  if (known) {
    lines.push(known.means);
    if (job.detail) lines.push(`The solver says: ${job.detail}.`);
    if (known.tone !== "good" && job.state === "finished") lines.push(...unmet(job, options));
    lines.push(...kindOfAnswer(job, options, solution));
  }
  lines.push(...proof(job));
  lines.push(...slow(job, rows));
  const word = job.state === "finished" ? job.status || "ended" : job.state;
  return { tone: job.state === "finished" ? (known?.tone ?? "quiet") : job.state, title: word.replaceAll("_", " "), lines };
}

// A job tells whether its answer is proved; the tests of its point are in the answer alone.
function kindOfAnswer(job, options, solution) {
  if (job.state !== "finished" || job.levels.length > 0) return [];
  const untested = solution === null && job.status === "solved" && !job.proved;
  const facts = {
    ...job,
    bStationary: solution?.b_stationary,
    secondOrder: untested ? "minimum" : short(solution?.second_order, "SECOND_ORDER_"),
    feasible: judge(job, options).every(({ met }) => met),
    pairs: job.nc,
    budgetSpent: job.factorizations >= Number(options?.local_search_budget ?? 1000) && !job.detail?.includes("segments; "),
    starts: Number(options?.starts ?? 1),
    globalSearch: options?.global === true,
  };
  const said = job.proved && job.nodes > 0; // by the proof's own line
  const kind = untested ? "It is not proved that no point is better." : `The answer: ${kindText(facts)}.`;
  const advice = whatToTry(facts);
  return [...(said ? [] : [kind]), ...(advice ? [`What to try: ${advice}`] : [])];
}

function underWay(job, options) {
  const lines = [STATES[job.state] ?? ""];
  if (job.state === "queued") lines.push(`${whole(job.position)} before it; likely to wait ${duration(job.wait_s)} yet.`);
  if (job.state !== "running" || job.kind === "session") return lines;
  if (job.activity) lines.push(`Now: ${job.activity}.`);
  if (options?.global === true && job.nodes === 0) lines.push("It looks for a first good point; then its tree begins, and with it a bound.");
  return lines;
}

/** How much of its time limit a running job has used: {used, limit} in seconds; null where there is none. */
export function timeLimit(job, options) {
  const limit = Number(options?.time_limit_s ?? Infinity);
  if (job.state !== "running" || job.kind === "session" || !(limit < 1e8)) return null;
  return { used: Math.min(limit, Math.max(0, seconds(job) - job.times.queue)), limit };
}

// The message has field, index and rule.
function errorDetails(error) {
  const delay = (error.details ?? []).map((detail) => detail.retryDelay ?? detail.retry_delay).find(Boolean);
  return delay ? [error.message, `The server proposes to try again after ${delay}.`] : [error.message];
}

function unmet(job, options) {
  const broken = judge(job, options).filter(({ met, tolerance }) => !met && Number.isFinite(tolerance));
  if (broken.length === 0) return [];
  const texts = broken.map(({ name, value, tolerance, meaning }) => `${name} ${meaning} = ${residual(value)}, asked for ${residual(tolerance)}`);
  return [`Not met: ${texts.join("; ")}.`];
}

const PARTS = [["equality", "ne"], ["inequality", "ni"], ["left side of pair", "nc"], ["right side of pair", "nc"]];
const LEAST_SHARE = 1e-3;
const MOST_ROWS = 8;

/**
 * What an infeasible problem's certificate weighs most, as {row, multiplier}: multipliers of A z + b, C z + d, L z + l and
 * R z + r, one after the other.
 */
export function clashingRows(job, certificate) {
  const rows = [];
  let at = 0;
  for (const [name, count] of PARTS) {
    for (let row = 0; row < job[count]; ++row) rows.push({ row: `${name} ${row}`, multiplier: Number(certificate[at++] ?? 0) });
  }
  const largest = Math.max(0, ...rows.map(({ multiplier }) => Math.abs(multiplier)));
  const weighing = rows.filter(({ multiplier }) => Math.abs(multiplier) > LEAST_SHARE * largest);
  weighing.sort((a, b) => Math.abs(b.multiplier) - Math.abs(a.multiplier));
  return { rows: weighing.slice(0, MOST_ROWS), more: Math.max(0, weighing.length - MOST_ROWS) };
}

const CONFLICT_PARTS = [
  ["equality", "equalities", "A z + b = 0"],
  ["inequality", "inequalities", "C z + d ≥ 0"],
  ["left side of pair", "left_sides", "L z + l ≥ 0"],
  ["right side of pair", "right_sides", "R z + r ≥ 0"],
  ["complementarity of pair", "complementarities", "L z + l = 0 or R z + r = 0"],
];
const MOST_PARTS = 100;

/**
 * What a conflict says: its parts as {part, needs}, how many more it has, and whether it is minimal. `conflict` is the
 * solution's, null where it has none.
 */
export function conflictingParts(conflict) {
  const parts = CONFLICT_PARTS.flatMap(([name, field, needs]) => (conflict?.[field] ?? []).map((row) => ({ part: `${name} ${row}`, needs })));
  return { parts: parts.slice(0, MOST_PARTS), more: Math.max(0, parts.length - MOST_PARTS), minimal: conflict?.minimal === true, detail: conflict?.detail ?? "" };
}

// What is known of the optimum, where a tree has looked for it.
function proof({ nodes, openNodes, state, status, proved, incumbent, bound, gap }) {
  if (nodes === 0) return [];
  const count = `${whole(nodes)} ${nodes === 1 ? "node" : "nodes"}`;
  if (proved) return [status === "infeasible" ? `Proved infeasible: ${count}.` : `Proved optimal: gap ${residual(gap)}, ${count}.`];
  const best = Number.isFinite(incumbent) ? `The best point has objective ${real(incumbent)}` : "No feasible point is known";
  const least = Number.isFinite(bound) ? `no point has less than ${real(bound)}` : "nothing bounds the objective from below";
  const distance = Number.isFinite(gap) ? `; gap ${residual(gap)}` : "";
  return [`Not proved${state === "finished" ? "" : " yet"}. ${best}, ${least}${distance}. ${count}, ${whole(openNodes)} open.`];
}

// What took long, where something stands out.
function slow(job, rows) {
  const lines = [];
  const total = seconds(job);
  if (job.times.queue > 0.5 * total && job.times.queue > 0.01) {
    lines.push(`Most of its time it waited: ${duration(job.times.queue)} of ${duration(total)} in the queue.`);
  } else if (job.times.solve > 0) {
    const [name, longest] = partsOf(job.times).reduce((a, b) => (b[1] > a[1] ? b : a));
    if (longest > 0.5 * total) lines.push(`Most of its time went into ${name}: ${duration(longest)}, ${percent(longest / total)} of the whole.`);
  }
  const again = repeated(rows).reduce((sum, count) => sum + count, 0);
  if (again > 0) lines.push(`${whole(again)} ${again === 1 ? "factorization was" : "factorizations were"} repeated because regularization had to be raised (marked in the plot).`);
  return lines;
}
