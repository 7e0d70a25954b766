import { wholeOrZero } from "../base/checks.js";
import { type MarbleError, invalid, within } from "../base/errors.js";
import type { Connection } from "../connection/connection.js";
import { type ArrayElement as ElementMessage, JobsService, type SubmitArrayRequest } from "../generated/marble/v1/service.js";
import { type CheckedProblem, type Problem, type ProblemUpdate, checkProblem, updateMessage } from "../model/problem.js";
import { sensitivityMessage } from "../model/sensitivity.js";
import { Solution } from "../model/solution.js";
import { type CallControls, serverStream } from "./calls.js";
import { Patience } from "./patience.js";
import { type CommonControls, type RequestControls, expect, initialPoint, requestOf, solveRequest, warmStartOf } from "./solve.js";
import { errorOfStatus, isLost } from "./status.js";

/** One problem of an array: one of its own, or the base problem with new numbers. */
export interface ArrayElement extends Omit<RequestControls, "priority" | "requestId"> {
  problem?: Problem;
  /** New numbers for the base problem. */
  update?: ProblemUpdate;
}

/** What holds for an array as a whole. */
export interface ArrayControls extends CommonControls, CallControls {
  /** The problem of which elements may be new numbers. */
  base?: Problem;
  /** For the server's log and page. */
  name?: string;
}

/** An array that was taken in. */
export interface SubmittedArray {
  jobId: string;
  elements: number;
}

/** What came of one element: its solution, or why there is none. */
export type ArrayAnswer = {
  /** Its position in the array, from 0. */
  index: number;
  /** The number of its answer in the order in which elements ended, from 1; it stays. */
  sequence: number;
} & ({ solution: Solution; error?: undefined } | { solution?: undefined; error: MarbleError });

/** How to be told of an array's answers. */
export interface ArrayReading {
  /** Only answers after this one: the largest `sequence` that was received before. */
  after?: number;
  signal?: AbortSignal;
}

/** All messages of one submission, however often they are sent. Throws where one breaks a rule. */
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
    if (update !== undefined) throw invalid("update", "must not come with a problem of its own");
    return { solve: solveRequest(problem, controls), update: undefined };
  }
  if (base === undefined) throw invalid("problem", "must be there where the array has no base");
  const { shape } = base;
  const solve = {
    ...requestOf(undefined, controls),
    initialPoint: initialPoint(controls.initialPoint, shape.variables),
    warmStart: controls.warmStart && warmStartOf(controls.warmStart),
    sensitivity: controls.sensitivity && sensitivityMessage(controls.sensitivity, shape),
  };
  return { solve, update: update && updateMessage(update, shape) };
}

/** Each answer once, whatever becomes of connections. */
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
      if (!isLost(error)) throw error;
      patience ??= new Patience({ totalMs: connection.waitMs, signal });
      await patience.pause(error);
    }
  }
}
