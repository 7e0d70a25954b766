import { inspect } from "node:util";

import { unpackDoubles } from "../base/packed.js";
import { statusAdvice } from "../base/tables.js";
import { type Words, word } from "../base/words.js";
import {
  PointOrigin as PointOriginNumber,
  SecondOrder as SecondOrderNumber,
  type Solution as Message,
  Stationarity as StationarityNumber,
  Status as StatusNumber,
  type Times as TimesMessage,
} from "../generated/marble/v1/solution.js";
import { type Conflict, conflictOf } from "./conflict.js";
import { type SolveOptions, optionsOf } from "./options.js";
import { type Violations, treeOf, violationsOf } from "./progress.js";
import { type SensitivityAnswer, sensitivityOf } from "./sensitivity.js";
import { type SolutionFacts, type SolutionKind, kindOf, kindText, whatToTry } from "./solution-kind.js";

/** Why a solve ended. */
export type Status = Words<typeof StatusNumber, "STATUS_">;

/** Where a point comes from: this solve, or the solution that a session had before it. */
export type PointOrigin = Words<typeof PointOriginNumber, "POINT_ORIGIN_">;

/** Kinds of stationary points; each includes those before it. */
export type Stationarity = Words<typeof StationarityNumber, "STATIONARITY_">;

/**
 * What the curvature of Q says of a stationary point on its critical cone (rows with a multiplier stay at zero, other active
 * rows may grow): "saddle" is no local minimum, "minimum" is one, "necessary" says that not all of the cone, or not whether
 * the point is B-stationary, was decided.
 */
export type SecondOrder = Words<typeof SecondOrderNumber, "SECOND_ORDER_">;

/** Seconds, by part. */
export interface Times extends TimesMessage {}

/** The answer of a solve, solved or not, in the problem's units. At a solution Qz + g + Aᵀy − Cᵀν − Lᵀξ − Rᵀη = 0, ν ≥ 0. */
export class Solution {
  /** The server's id of the job. */
  readonly jobId: string;
  /** Why the solve ended; "unknown" of a newer server. */
  readonly status: Status | "unknown";
  /** One sentence with the numbers that justify the status. */
  readonly detail: string;
  /** "previous" where a session's solve was cut off and only the solution before it, moved on, is feasible. */
  readonly origin: PointOrigin;
  /** The point, n entries; the best iterate where it is not solved. */
  readonly z: Float64Array;
  /** y, one a row of A, of any sign. */
  readonly equalityMultipliers: Float64Array;
  /** ν ≥ 0, one a row of C. */
  readonly inequalityMultipliers: Float64Array;
  /** ξ, one a pair, of L z + l ≥ 0. */
  readonly leftMultipliers: Float64Array;
  /** η, one a pair, of R z + r ≥ 0. */
  readonly rightMultipliers: Float64Array;
  /**
   * Of "infeasible" the multipliers (y, ν, ξ, η) that prove it, or empty where each branch was refuted by itself; of
   * "unbounded" a direction from z on; else empty.
   */
  readonly certificate: Float64Array;
  /** ½ zᵀQz + gᵀz + c0. */
  readonly objective: number;
  /** Violations at z. */
  readonly violations: Violations;
  /** max |Qz + g + Aᵀy − Cᵀν − Lᵀξ − Rᵀη|. */
  readonly kktResidual: number;
  /** Newton iterations. */
  readonly iterations: number;
  /** Numeric factorizations, rejected ones included. */
  readonly factorizations: number;
  /** Where the time went. */
  readonly times: Times;
  /** Every option as it was used. */
  readonly options: SolveOptions;
  /** Of a solved one. */
  readonly stationarity?: Stationarity;
  /** No feasible direction of descent is left; absent where that was not decided. */
  readonly bStationary?: boolean;
  /** Whether a solved point is a local minimum. */
  readonly secondOrder?: SecondOrder;
  /**
   * Of option global: z is within gapTolerance of the bound, or a tree ended infeasible; also, without it, of a certificate,
   * and of a small problem whose tree came to its end within smallBudget. Where z of option global is not proved, `detail`
   * says why.
   */
  readonly proved: boolean;
  /**
   * No feasible point has an objective below this. −Infinity where none is known, so of what neither option global nor
   * smallBudget has bounded; Infinity of a problem that is proved infeasible.
   */
  readonly bound: number;
  /** (objective − bound) / max(1, |objective|), ≥ 0; Infinity without a feasible point or a bound. */
  readonly gap: number;
  /** Nodes of the tree of option global or smallBudget that were bounded; 0 where there was none. */
  readonly nodes: number;
  /** Nodes of the tree left open at the end: 0 of one that was searched to its end. */
  readonly openNodes: number;
  /** Nodes of a session's last tree that this one began with instead of the root, bounded anew by their multipliers. */
  readonly warmNodes: number;
  /** What a cold start last reached: the objective itself, or of a chain of warm starts that of its first. */
  readonly coldObjective: number;
  /** The derivatives that were asked for; absent where none were. */
  readonly sensitivity?: SensitivityAnswer;
  /** Of option explain: which parts make the problem infeasible; absent where it is not proved to be. */
  readonly conflict?: Conflict;
  /** Rows of progress that were dropped because they were not taken fast enough. */
  readonly progressSkipped: number;

  /** @internal */
  constructor(jobId: string, message: Message, progressSkipped = 0) {
    this.jobId = jobId;
    this.status = word(StatusNumber, "STATUS_", message.status) ?? "unknown";
    this.detail = message.detail;
    this.origin = word(PointOriginNumber, "POINT_ORIGIN_", message.origin) ?? "solve";
    this.z = unpackDoubles(message.z);
    this.equalityMultipliers = unpackDoubles(message.equalityMultipliers);
    this.inequalityMultipliers = unpackDoubles(message.inequalityMultipliers);
    this.leftMultipliers = unpackDoubles(message.complementarityMultipliersL);
    this.rightMultipliers = unpackDoubles(message.complementarityMultipliersR);
    this.certificate = unpackDoubles(message.certificate);
    this.objective = message.objective;
    this.violations = violationsOf(message.violations);
    this.kktResidual = message.kktResidual;
    this.iterations = message.iterations;
    this.factorizations = message.factorizations;
    this.times = timesOf(message.times);
    this.options = optionsOf(message.options);
    this.stationarity = word(StationarityNumber, "STATIONARITY_", message.stationarity);
    this.bStationary = message.bStationary;
    this.secondOrder = word(SecondOrderNumber, "SECOND_ORDER_", message.secondOrder);
    this.proved = message.proved;
    const tree = treeOf(message);
    this.bound = tree.bound;
    this.gap = tree.gap;
    this.nodes = tree.nodes;
    this.openNodes = tree.openNodes;
    this.warmNodes = message.warmNodes;
    this.coldObjective = message.coldObjective;
    this.sensitivity = message.sensitivity && sensitivityOf(message.sensitivity, this.z.length);
    this.conflict = message.conflict && conflictOf(message.conflict);
    this.progressSkipped = progressSkipped;
  }

  /** All tolerances are met, or 100 times them where no more was possible. */
  get solved(): boolean {
    return this.status === "solved" || this.status === "solved_reduced";
  }

  /** What to try; empty where there is nothing to mend. */
  get advice(): string {
    return this.status === "unknown" ? "" : statusAdvice[this.status];
  }

  /** What kind of answer it is: proved optimal, a local minimum, only a stationary point, and so on. */
  get kind(): SolutionKind {
    return kindOf(this.facts());
  }

  /** The kind in a line: "proved optimal", "local minimum; no bound is known". */
  get kindText(): string {
    return kindText(this.facts());
  }

  /** What may give a better answer, and what that costs; empty where nothing does. */
  get whatToTry(): string {
    return whatToTry(this.facts());
  }

  private facts(): SolutionFacts {
    const { violations, options } = this;
    return {
      ...this,
      feasible:
        violations.equality <= (options.equalityTolerance ?? 1e-6) &&
        violations.inequality <= (options.inequalityTolerance ?? 1e-6) &&
        violations.complementarity <= (options.complementarityTolerance ?? 1e-6),
      pairs: this.leftMultipliers.length,
      budgetSpent: this.factorizations >= (options.localSearchBudget ?? 1000) && !this.detail.includes("segments; "),
      starts: options.starts ?? 1,
      globalSearch: options.global ?? false,
    };
  }

  /** One line: how it ended, at what, how fast. */
  toString(): string {
    const ms = (1000 * this.times.solveS).toPrecision(3);
    const { equality, inequality, complementarity } = this.violations;
    const worst = Math.max(equality, inequality, complementarity);
    const tree = this.nodes > 0 ? `, ${this.nodes} node${this.nodes === 1 ? "" : "s"}` : "";
    return (
      `${this.status}: objective ${Number(this.objective.toPrecision(10))}, ${this.iterations} iterations, ` +
      `${this.factorizations} factorizations, ${ms} ms, violation ${worst.toExponential(1)}${tree}; ${this.kindText}`
    );
  }

  [inspect.custom](_depth: number, options: object): string {
    const { z, violations, detail, times } = this;
    return `Solution ${this.toString()} ${inspect({ detail, z, violations, times }, { ...options, maxArrayLength: 6 })}`;
  }
}

export function timesOf(message: TimesMessage | undefined): Times {
  return message ?? { queueS: 0, setupS: 0, factorizationS: 0, lineSearchS: 0, solveS: 0, totalS: 0, polishS: 0, treeS: 0 };
}
