import { statusAdvice } from "../base/tables.js";
import type { SecondOrder, Status } from "./solution.js";

/** Up to this gap the text says "proved optimal" alone. */
const noGap = 1e-6;
const spent = "The search for better branches has spent local_search_budget: a larger one lets it go on. ";

/**
 * What a solution is worth. "proved_optimal": within gapTolerance of the bound. "optimal": of a problem without pairs
 * whose Q is known to be convex, by the tolerances. "local_minimum": no better point is near; one may be elsewhere. "stationary_point": solved, but not decided whether it is a local minimum. "saddle_point": solved,
 * and no local minimum. "almost_solved": the reduced tolerances only. "no_feasible_point": none was found; there may be
 * one. "stopped_feasible", "stopped_infeasible": a limit or a cancel ended the solve, at a point that meets the tolerances,
 * or does not. "failed": no acceptable step was found.
 */
export type SolutionKind =
  | "proved_optimal"
  | "optimal"
  | "local_minimum"
  | "stationary_point"
  | "saddle_point"
  | "almost_solved"
  | "proved_infeasible"
  | "no_feasible_point"
  | "proved_unbounded"
  | "stopped_feasible"
  | "stopped_infeasible"
  | "failed";

/**
 * What the kind of a solution, its text and its advice follow from. The rules are those of marble/report/solution_kind.h;
 * tests/answers/kinds.json is the table of cases for all languages.
 */
export interface SolutionFacts {
  status: Status | "unknown";
  proved: boolean;
  bStationary?: boolean | undefined;
  secondOrder?: SecondOrder | undefined;
  objective: number;
  gap: number;
  /** Whether z is within the tolerances. */
  feasible: boolean;
  pairs: number;
  factorizations: number;
  /** The factorizations have reached the option localSearchBudget. Never of an answer by segments: each has that budget. */
  budgetSpent: boolean;
  /** The option. */
  starts: number;
  /** The option global. */
  globalSearch: boolean;
}

/** The kind of a solution. */
export function kindOf(facts: SolutionFacts): SolutionKind {
  switch (facts.status) {
    case "solved":
      if (facts.proved) return "proved_optimal";
      if (facts.secondOrder === "saddle") return "saddle_point";
      if (facts.bStationary === false) return "stationary_point";
      if (facts.secondOrder === "convex" && facts.pairs === 0) return "optimal";
      return facts.secondOrder === "minimum" || facts.secondOrder === "convex" ? "local_minimum" : "stationary_point";
    case "solved_reduced":
      return "almost_solved";
    case "infeasible":
      return "proved_infeasible";
    case "locally_infeasible":
      return "no_feasible_point";
    case "unbounded":
      return "proved_unbounded";
    case "iteration_limit":
    case "time_limit":
    case "cancelled":
      return facts.feasible ? "stopped_feasible" : "stopped_infeasible";
    default:
      return "failed";
  }
}

/** In one line: "proved optimal", "local minimum; no bound is known". */
export function kindText(facts: SolutionFacts): string {
  switch (kindOf(facts)) {
    case "proved_optimal":
      return facts.gap > noGap && Number.isFinite(facts.gap) ? `proved optimal to within ${distance(facts)}` : "proved optimal";
    case "optimal":
      return "optimal: Q is convex, and there are no pairs";
    case "local_minimum":
      return `local minimum; ${facts.pairs === 0 && !Number.isFinite(facts.gap) ? "the optimum where Q is convex" : boundText(facts)}`;
    case "stationary_point":
      return `stationary point only: ${undecided(facts)}; ${boundText(facts)}`;
    case "saddle_point":
      return "saddle point: the objective falls along a direction of negative curvature";
    case "almost_solved":
      return "almost solved: the tolerances are met up to a factor of 100 only";
    case "proved_infeasible":
      return "proved infeasible: no point meets the constraints";
    case "no_feasible_point":
      return "no feasible point found; infeasibility is not proved";
    case "proved_unbounded":
      return "proved unbounded: the objective falls without end";
    case "stopped_feasible":
      return `stopped at a feasible point; ${boundText(facts)}`;
    case "stopped_infeasible":
      return "stopped before a feasible point was found";
    case "failed":
      return "failed: no acceptable step was found";
  }
}

/** What may give a better answer, and what that costs; empty where nothing does. */
export function whatToTry(facts: SolutionFacts): string {
  switch (kindOf(facts)) {
    case "proved_optimal":
    case "optimal":
      return "";
    case "local_minimum":
      return (facts.pairs === 0 ? "Where Q is not convex: " : "") + startsAdvice(facts) + globalAdvice(facts);
    case "stationary_point":
      return (facts.budgetSpent ? spent : "") + startsAdvice(facts) + globalAdvice(facts);
    case "saddle_point":
      return "Raise local_search_budget or time_limit_s: the descent from the saddle point was cut short.";
    default:
      return facts.status === "unknown" ? "" : statusAdvice[facts.status];
  }
}

// Rounded up, for the sentence says "at most". A gap is relative to the objective only where that is above 1.
function distance({ objective, gap }: SolutionFacts): string {
  if (Math.abs(objective) < 1) return (Math.ceil(1e3 * gap) / 1e3).toFixed(3);
  const percent = 100 * gap;
  if (percent >= 10) return `${Math.ceil(percent).toFixed(0)} %`;
  if (percent >= 1) return `${(Math.ceil(10 * percent) / 10).toFixed(1)} %`;
  return `${(Math.max(1, Math.ceil(100 * percent)) / 100).toFixed(2)} %`;
}

function boundText(facts: SolutionFacts): string {
  return Number.isFinite(facts.gap) ? `at most ${distance(facts)} from the optimum` : "no bound is known";
}

function undecided({ bStationary, pairs }: SolutionFacts): string {
  if (bStationary === false) return "the objective falls along another branch";
  return bStationary === true || pairs === 0 ? "its curvature was not decided" : "a better branch may lie next to it";
}

function startsAdvice({ starts, factorizations }: SolutionFacts): string {
  const work = ` (this solve: ${factorizations} factorization${factorizations === 1 ? "" : "s"}).`;
  if (starts > 1) return `starts=${2 * starts} searches twice as often, for about twice the work${work}`;
  return `starts=8 searches 8 times, for about 8 times the work${work}`;
}

function globalAdvice({ globalSearch, pairs }: SolutionFacts): string {
  if (globalSearch) return " The proof did not come to its end: detail says why.";
  if (pairs === 0) return "";
  return (
    ` global=true searches the branches of the ${pairs} pair${pairs === 1 ? "" : "s"} for the best one and proves it; ` +
    "that may take much longer, and time_limit_s ends it with a bound."
  );
}
