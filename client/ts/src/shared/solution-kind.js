// The kind of a solution, in words, and what a better one costs. The texts are those of
// contract.def, the rules those of marble/report/solution_kind.h; tests/answers has cases for all languages.
// JavaScript, because the server's page uses this file as it is.
import { kinds, phrases, statuses } from "./tables.js";

/** Up to this gap the text says "proved optimal" alone. */
const noGap = 1e-6;

/**
 * What kind of answer a solution is: `client/SOLVING.md` in the checkout explains each.
 * @typedef {keyof typeof kinds} SolutionKind
 */

/**
 * What the kind of a solution, its text and its advice follow from. feasible: z is within the tolerances. budgetSpent:
 * see isBudgetSpent. starts, globalSearch: the options num_starts and global_search.
 * @typedef {{status: string, proved: boolean, bStationary?: boolean | undefined, secondOrder?: string | undefined,
 *   objective: number, gap: number, feasible: boolean, pairs: number, factorizations: number, budgetSpent: boolean,
 *   starts: number, globalSearch: boolean}} SolutionFacts
 */

/** @type {Readonly<Record<string, SolutionKind>>} */
const byStatus = {
  almost_solved: "almost_solved",
  infeasible: "proved_infeasible",
  locally_infeasible: "no_feasible_point",
  unbounded: "proved_unbounded",
};

/** Returns the kind of a solution. @param {SolutionFacts} facts @returns {SolutionKind} */
export function kindOf({ status, proved, bStationary, secondOrder, pairs, feasible }) {
  if (["iteration_limit", "time_limit", "cancelled"].includes(status))
    return feasible ? "stopped_feasible" : "stopped_infeasible";
  if (status !== "solved") return byStatus[status] ?? "failed";
  if (proved) return "proved_optimal";
  if (secondOrder === "saddle") return "saddle_point";
  if (bStationary === false || !["minimum", "convex"].includes(secondOrder ?? "")) return "stationary_point";
  return secondOrder === "convex" && pairs === 0 ? "optimal" : "local_minimum";
}

/** In one line: "proved optimal", "local minimum; no bound is known". @param {SolutionFacts} facts */
export function kindText(facts) {
  return filled(kinds[kindOf(facts)].text, partsOf(facts));
}

/** What may give a better answer, and what that costs; "" if nothing does. @param {SolutionFacts} facts */
export function whatToTry(facts) {
  return filled(kinds[kindOf(facts)].advice, partsOf(facts));
}

/**
 * Whether the search for better branches has spent its budget. Each search has its own, and option effort adds to that of
 * the first one. In a solution by segments each of them had the budget, so their sum decides nothing.
 * @param {{factorizations: number, detail?: string | undefined}} solution
 * @param {{maxLocalSearchFactorizations?: number | undefined, numStarts?: number | undefined, effort?: number | undefined}} options
 */
export function isBudgetSpent({ factorizations, detail = "" }, { maxLocalSearchFactorizations = 1000, numStarts = 1, effort = 1 }) {
  return factorizations >= maxLocalSearchFactorizations * (numStarts + effort) && !detail.includes("segments; ");
}

/** "1 pair", "2 pairs". @param {number} count @param {string} noun */
export function counted(count, noun) {
  return `${count} ${noun}${count === 1 ? "" : "s"}`;
}

/** What the texts have in braces. @param {SolutionFacts} facts @returns {Record<string, string>} */
function partsOf({ status, bStationary, objective, gap, pairs, factorizations, budgetSpent, starts, globalSearch }) {
  const bounded = Number.isFinite(gap);
  const bound = bounded ? phrases.bounded : phrases.not_bounded;
  const undecided = bStationary || pairs === 0 ? phrases.curvature : phrases.next_branch;
  const tree = pairs === 0 ? "" : phrases.try_global;
  return {
    bound,
    within: bounded && gap > noGap ? phrases.within : "",
    optimum: pairs === 0 && !bounded ? phrases.optimum_if_convex : bound,
    reason: bStationary === false ? phrases.another_branch : undecided,
    condition: pairs === 0 ? phrases.if_not_convex : "",
    budget: budgetSpent ? phrases.budget_spent : "",
    starts: starts > 1 ? phrases.more_starts : phrases.first_starts,
    proof: globalSearch ? phrases.proof_ended : tree,
    status: Object.entries(statuses).find(([name]) => name === status)?.[1].advice ?? "",
    more: `${2 * starts}`,
    factorizations: counted(factorizations, "factorization"),
    pairs: counted(pairs, "pair"),
    distance: distance(objective, gap),
  };
}

/** @param {string} text @param {Record<string, string>} parts @returns {string} */
function filled(text, parts) {
  return text.replace(/\{(\w+)\}/g, (_, part) => filled(parts[part], parts));
}

// Rounded up, because the sentence says "at most". A gap is relative to the objective only if that is above 1.
/** @param {number} objective @param {number} gap */
function distance(objective, gap) {
  if (Math.abs(objective) < 1) return (Math.ceil(1e3 * gap) / 1e3).toFixed(3);
  const percent = 100 * gap;
  if (percent >= 10) return `${Math.ceil(percent).toFixed(0)} %`;
  if (percent >= 1) return `${(Math.ceil(10 * percent) / 10).toFixed(1)} %`;
  return `${(Math.max(1, Math.ceil(100 * percent)) / 100).toFixed(2)} %`;
}
