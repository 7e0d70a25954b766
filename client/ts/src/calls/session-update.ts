import { checkDeadline, untilForever, wholeOrZero } from "../base/checks.js";
import { invalid } from "../base/errors.js";
import type { SessionUpdate, Shift as ShiftMessage } from "../generated/marble/v1/session.js";
import { type SolveOptions, optionsMessage } from "../model/options.js";
import { type Problem, type ProblemUpdate, type Shape, checkProblem, updateMessage } from "../model/problem.js";
import { type SensitivityRequest, sensitivityMessage } from "../model/sensitivity.js";
import { initialPoint } from "./solve.js";

/** What may accompany one update; all of it optional. */
export interface UpdateControls {
  /** From here on; what is left out stays. `scalingPasses` is fixed by the set-up. */
  options?: SolveOptions;
  /** Start here instead of at the last solution. */
  initialPoint?: ArrayLike<number>;
  /** Forget the last solution. */
  cold?: boolean;
  /** The last solution moves on before it is started from. */
  shift?: Shift;
  /**
   * No answer is wanted later than this after the update's arrival, in milliseconds > 0. A solve that has begun ends in
   * time with status "time_limit" and its best point; an update that has not begun by then ends with a DeadlineError.
   */
  deadlineMs?: number;
  /** Derivatives of this answer that are wanted with it: `solution.sensitivity`. */
  sensitivity?: SensitivityRequest;
}

/** A stretch of a vector that moves on: of `count` entries from `first`, each takes the value `by` further on. */
export interface ShiftBlock {
  first: number;
  count: number;
  by: number;
}

/**
 * A receding horizon's hint: how the last solution moves one stage on. The blocks of a vector may move as many entries
 * together as it has; one that moves none counts as one.
 */
export interface Shift {
  variables?: ShiftBlock[];
  equalities?: ShiftBlock[];
  inequalities?: ShiftBlock[];
  pairs?: ShiftBlock[];
}

/**
 * For a problem whose vectors all hold `stages` equal parts, one stage after the other.
 * @throws InvalidProblemError of field "stages" unless it is ≥ 1 and divides the size of every vector.
 */
export function shiftByStage(problem: Problem, stages: number): Shift {
  const { shape } = checkProblem(problem);
  if (!Number.isInteger(stages) || stages < 1)
    throw invalid("stages", "must be a whole number >= 1", { value: stages });
  const block = (name: keyof Shift): ShiftBlock[] => {
    const count = shape[name];
    if (count % stages !== 0) throw invalid("stages", `must divide the number of ${name}, ${count}`, { value: stages });
    return count === 0 ? [] : [{ first: 0, count, by: count / stages }];
  };
  return {
    variables: block("variables"),
    equalities: block("equalities"),
    inequalities: block("inequalities"),
    pairs: block("pairs"),
  };
}

/** An update as it travels; throws an InvalidProblemError of a part that does not fit. */
export function updateOf(sequence: number, update: ProblemUpdate, controls: UpdateControls, shape: Shape): SessionUpdate {
  checkDeadline("deadlineMs", controls.deadlineMs);
  return {
    sequence,
    problem: updateMessage(update, shape),
    options: optionsMessage(controls.options),
    initialPoint: initialPoint(controls.initialPoint, shape.variables),
    cold: controls.cold ?? false,
    shift: controls.shift && shiftMessage(controls.shift),
    deadlineS: (untilForever(controls.deadlineMs) ?? 0) / 1000,
    prepare: false,
    sensitivity: controls.sensitivity && sensitivityMessage(controls.sensitivity, shape),
    epoch: 0,
  };
}

function shiftMessage(shift: Shift): ShiftMessage {
  const blocks = (name: keyof Shift): ShiftBlock[] => {
    for (const [k, block] of (shift[name] ?? []).entries()) {
      for (const part of ["first", "count", "by"] as const) wholeOrZero(`shift.${name}[${k}].${part}`, block[part]);
    }
    return shift[name] ?? [];
  };
  return {
    variables: blocks("variables"),
    equalities: blocks("equalities"),
    inequalities: blocks("inequalities"),
    pairs: blocks("pairs"),
  };
}
