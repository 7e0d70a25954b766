import { wholeOrZero } from "../checks.js";
import { type MarbleError, RefusedError, invalid, within } from "../errors.js";
import type { Connection } from "../connection/connection.js";
import { type ArrayElement as ElementMessage, JobsService, type SubmitArrayRequest } from "../generated/marble/v1/service.js";
import { type CheckedProblem, type Problem, type ProblemUpdate, checkProblem, updateMessage } from "../model/problem.js";
import { sensitivityMessage } from "../model/sensitivity.js";
import { Solution } from "../model/solution.js";
import { type CallControls, serverStream } from "./calls.js";
import { Patience } from "./patience.js";
import { type CommonControls, type RequestControls, expect, initialPoint, requestOf, solveRequest, warmStartOf } from "./solve.js";
import { errorOfStatus, isLost } from "./status.js";

/** One problem of an array: its own problem, or the base problem with new data. */
export interface ArrayElement extends Omit<RequestControls, "priority" | "requestId"> {
  problem?: Problem;
  /** New data for the base problem. */
  update?: ProblemUpdate;
}

/** Parameters of a whole array. */
export interface ArrayControls extends CommonControls, CallControls {
  /** The problem that elements with an `update` change. */
  base?: Problem;
  /** For the server's log and page. */
  name?: string;
}

/** An accepted array. */
export interface SubmittedArray {
  jobId: string;
  elements: number;
}

/** The result of one element: its solution or its error. */
export type ArrayAnswer = {
  /** Its position in the array, from 0. */
  index: number;
  /** The number of the result in the order in which elements finished, from 1. It never changes. */
  sequence: number;
} & ({ solution: Solution; error?: undefined } | { solution?: undefined; error: MarbleError });

/** Parameters for reading an array's results. */
export interface ArrayReading {
  /** Only results after this one: the largest `sequence` received before. */
  after?: number;
  signal?: AbortSignal;
}

/**
 * All messages of one submission, which may be sent several times. Throws an InvalidProblemError for invalid elements.
 */
export function arrayMessages(
  elements: Iterable<ArrayElement>,
  requestId: string,
  controls: ArrayControls,
): SubmitArrayRequest[] {
  const base = controls.base && checkProblem(controls.base);
  const { options, priority } = requestOf(undefined, controls);
  const setup = { problem: base?.message, options, requestId, priority, name: controls.name ?? "" };
  const messages: SubmitArrayRequest[] = [{ request: { $case: "setup", value: setup } }];
  for (const element of elements) {
    const value = within(`elements[${messages.length - 1}]`, () => elementOf(element, base));
    messages.push({ request: { $case: "element", value } });
  }
  messages.push({ request: { $case: "end", value: { elements: messages.length - 1 } } });
  return messages;
}

function elementOf({ problem, update, ...controls }: ArrayElement, base: CheckedProblem | undefined): ElementMessage {
  if (problem !== undefined) {
    if (update !== undefined) throw invalid("update", "must not be given together with a problem");
    return { solve: solveRequest(problem, controls), update: undefined };
  }
  if (base === undefined) throw invalid("problem", "must be given if the array has no base");
  const { shape } = base;
  const solve = {
    ...requestOf(undefined, controls),
    initialPoint: initialPoint(controls.initialPoint, shape.variables),
    warmStart: controls.warmStart && warmStartOf(controls.warmStart),
    sensitivity: controls.sensitivity && sensitivityMessage(controls.sensitivity, shape),
  };
  return { solve, update: update && updateMessage(update, shape) };
}

/** Yields each result once, also across lost connections. Waits while the server has too many readers. */
export async function* arrayAnswers(
  connection: Connection,
  jobId: string,
  { after: from, signal }: ArrayReading,
): AsyncGenerator<ArrayAnswer, void, undefined> {
  let after = wholeOrZero("after", from);
  let patience: Patience | undefined;
  for (;;) {
    try {
      const messages = serverStream(connection, JobsService.arrayResults, { jobId, after }, { signal });
      for await (const { sequence, index, outcome } of messages) {
        after = sequence;
        patience = undefined;
        const { $case, value } = expect(outcome);
        if ($case === "error") yield { index, sequence, error: errorOfStatus(value) };
        else yield { index, sequence, solution: new Solution(value.jobId, expect(value.solution)) };
      }
      return;
    } catch (error) {
      if (error instanceof RefusedError && error.retryAfterMs !== undefined) {
        patience = undefined;
        await new Patience({ totalMs: Infinity, signal }).pause(error);
        continue;
      }
      if (!isLost(error)) throw error;
      patience ??= new Patience({ totalMs: connection.waitMs, signal });
      await patience.pause(error);
    }
  }
}
