import { inspect } from "node:util";

import { type Unpacked, unpackDoubles, unpackIntegers, unpacked } from "../packed.js";
import { type Words, word } from "../words.js";
import {
  type Conflict as ConflictMessage,
  PointOrigin as PointOriginNumber,
  SecondOrder as SecondOrderNumber,
  type Solution as Message,
  Stationarity as StationarityNumber,
  Status as StatusNumber,
  type Times as TimesMessage,
} from "../generated/marble/v1/solution.js";
import { type SolutionFacts, type SolutionKind, counted, isBudgetSpent, kindOf, kindText, whatToTry } from "../shared/solution-kind.js";
import { statuses } from "../shared/tables.js";
import { type SolveOptions, optionsOf } from "./options.js";
import { type Tree, type Violations, treeOf, violationsOf } from "./progress.js";
import { type SensitivityAnswer, sensitivityOf } from "./sensitivity.js";

/** Why a solve ended. */
export type Status = Words<typeof StatusNumber, "STATUS_">;

/** The source of a point: this solve, or the session's previous solution. */
export type PointOrigin = Words<typeof PointOriginNumber, "POINT_ORIGIN_">;

/** Kinds of stationary points; each includes those before it. */
export type Stationarity = Words<typeof StationarityNumber, "STATIONARITY_">;

/**
 * The second-order test of a stationary point on its critical cone: "saddle" is no local minimum, "minimum" is one,
 * "convex" is one and Q is convex, "necessary" means that the cone or B-stationarity was not decided completely.
 */
export type SecondOrder = Words<typeof SecondOrderNumber, "SECOND_ORDER_">;

/** Times of the parts of a solve, in seconds. */
export interface Times extends TimesMessage {}

/**
 * Parts of a problem that no point meets together, whatever the others are: indices from 0, ascending. A pair enters by
 * up to three parts: each of its sides being nonnegative, and one of them being zero.
 */
export interface Conflict extends Unpacked<ConflictMessage, Int32Array> {}

/** Fields of the message that only requests for several problems have; their calls return them by themselves. */
type Composite = "coupled" | "scenarios";

/** Fields that are words, have defaults or are made of messages. */
interface Converted extends Readonly<Tree> {
  /** Why the solve ended; "unknown" if the server is newer. */
  readonly status: Status | "unknown";
  /** "previous" if a session's solve was cut off and only the solution before it, shifted, is feasible. */
  readonly origin: PointOrigin;
  /** Violations at z. */
  readonly violations: Violations;
  /** Where the time went. */
  readonly times: Times;
  /** Every option as it was used, defaults included. */
  readonly options: SolveOptions;
  /** The kind of stationary point, if the problem is solved. */
  readonly stationarity?: Stationarity;
  /** Whether a solved point is a local minimum. */
  readonly secondOrder?: SecondOrder;
  /** The derivatives that were requested. */
  readonly sensitivity?: SensitivityAnswer;
  /** Of option explain: which parts make the problem infeasible; absent if it is not proved infeasible. */
  readonly conflict?: Conflict;
}

/**
 * The solution of a problem, solved or not, in the problem's units; its fields are those of the message `Solution`. At
 * a solution Qz + g + Aᵀy − Cᵀν − Lᵀξ − Rᵀη = 0, ν ≥ 0.
 */
export interface Solution extends Converted, Omit<Unpacked<Message, Float64Array>, keyof Converted | Composite> {}

export class Solution {
  /** The server's id of the job. */
  readonly jobId: string;
  /** Rows of progress that were dropped because they were not read fast enough. */
  readonly progressSkipped: number;

  /** @internal */
  constructor(jobId: string, { coupled, scenarios, ...message }: Message, progressSkipped = 0) {
    this.jobId = jobId;
    this.progressSkipped = progressSkipped;
    const fields = unpacked(message, unpackDoubles);
    const converted: Converted = {
      ...treeOf(message),
      status: word(StatusNumber, "STATUS_", message.status) ?? "unknown",
      origin: word(PointOriginNumber, "POINT_ORIGIN_", message.origin) ?? "solve",
      violations: violationsOf(message.violations),
      times: timesOf(message.times),
      options: optionsOf(message.options),
      stationarity: word(StationarityNumber, "STATIONARITY_", message.stationarity),
      secondOrder: word(SecondOrderNumber, "SECOND_ORDER_", message.secondOrder),
      sensitivity: message.sensitivity && sensitivityOf(message.sensitivity, fields.z.length),
      conflict: message.conflict && conflictOf(message.conflict),
    };
    Object.assign(this, fields, converted);
  }

  /** Whether all tolerances are met, or 100 times the tolerances if no more was possible. */
  get solved(): boolean {
    return this.status === "solved" || this.status === "almost_solved";
  }

  /** What to try after this status; empty if solved. */
  get advice(): string {
    return this.status === "unknown" ? "" : statuses[this.status].advice;
  }

  /** The kind of the solution: proved optimal, a local minimum, only a stationary point, and so on. */
  get kind(): SolutionKind {
    return kindOf(this.facts());
  }

  /** The kind as text: "proved optimal", "local minimum; no bound is known". */
  get kindText(): string {
    return kindText(this.facts());
  }

  /** What may lead to a better solution, and its cost; empty if nothing does. */
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
      pairs: this.complementarityMultipliersL.length,
      budgetSpent: isBudgetSpent(this, options),
      starts: options.numStarts ?? 1,
      globalSearch: options.globalSearch ?? false,
    };
  }

  /** One line with status, objective, work and kind. */
  toString(): string {
    const ms = (1000 * this.times.solveS).toPrecision(3);
    const { equality, inequality, complementarity } = this.violations;
    const worst = Math.max(equality, inequality, complementarity);
    const tree = this.nodes > 0 ? `, ${counted(this.nodes, "node")}` : "";
    const work = `${counted(this.iterations, "iteration")}, ${counted(this.factorizations, "factorization")}`;
    const violation = `violation ${worst.toExponential(1)}`;
    return `${this.status}: objective ${Number(this.objective.toPrecision(10))}, ${work}, ${ms} ms, ${violation}${tree}; ${this.kindText}`;
  }

  [inspect.custom](_depth: number, options: object): string {
    const { z, violations, detail, times } = this;
    return `Solution ${this.toString()} ${inspect({ detail, z, violations, times }, { ...options, maxArrayLength: 6 })}`;
  }
}

export function conflictOf(message: ConflictMessage): Conflict {
  return unpacked(message, unpackIntegers);
}

export function timesOf(message: TimesMessage | undefined): Times {
  return message ?? { queueS: 0, setupS: 0, factorizationS: 0, lineSearchS: 0, solveS: 0, totalS: 0, polishS: 0, treeS: 0 };
}
