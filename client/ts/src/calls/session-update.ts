import { checkDeadline, untilForever, wholeOrZero } from "../checks.js";
import { invalid } from "../errors.js";
import type { SessionUpdate, Shift as ShiftMessage } from "../generated/marble/v1/session.js";
import { type SolveOptions, optionsMessage } from "../model/options.js";
import { type Problem, type ProblemUpdate, type Shape, checkProblem, updateMessage } from "../model/problem.js";
import { type SensitivityRequest, sensitivityMessage } from "../model/sensitivity.js";
import { initialPoint } from "./solve.js";

/** Parameters of one update. All are optional. */
export interface UpdateControls {
  /** Options from this update on; the others stay as they are. `scalingPasses` is fixed by the set-up. */
  options?: SolveOptions;
  /** Starting point instead of the last solution. */
  initialPoint?: ArrayLike<number>;
  /** Starts without the last solution. */
  cold?: boolean;
  /** Shifts the last solution before the solve starts from it. */
  shift?: Shift;
  /**
   * Deadline from the arrival of the update, in milliseconds > 0. A solve that has begun ends in time with status
   * "time_limit" and its best point; an update that has not begun by then rejects with a DeadlineError.
   */
  deadlineMs?: number;
  /** Derivatives to compute with the solution, returned in `solution.sensitivity`. */
  sensitivity?: SensitivityRequest;
}

/** A block of a vector to shift: each of `count` entries from `first` gets the value that is `by` entries later. */
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
 * Shifts by one stage. All vectors of the problem must consist of `stages` equal parts, one after the other.
 * @throws InvalidProblemError with the field "stages" unless it is ≥ 1 and divides the size of every vector.
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

/** The message of an update; throws an InvalidProblemError if a part does not fit. */
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
