import { secondsOrZero, wholeOrZero } from "../checks.js";
import { errorOf, invalid } from "../errors.js";
import { packDoubles } from "../packed.js";
import { type Words, valueOf, words } from "../words.js";
import type { Connection } from "../connection/connection.js";
import { Priority as PriorityNumber } from "../generated/marble/v1/job.js";
import type { Problem as ProblemMessage } from "../generated/marble/v1/problem.js";
import { SolverService, type SolveRequest, type SolveStreamResponse } from "../generated/marble/v1/service.js";
import { WarmStart } from "../generated/marble/v1/solution.js";
import { takeVector } from "../model/matrix.js";
import { type SolveOptions, optionsMessage } from "../model/options.js";
import { type Problem, checkProblem } from "../model/problem.js";
import { type Progress, progressOf } from "../model/progress.js";
import { type SensitivityRequest, sensitivityMessage } from "../model/sensitivity.js";
import { Solution } from "../model/solution.js";
import { type CallControls, serverStream, unary } from "./calls.js";

/** The order in which busy workers take jobs: control loops first, then interactive jobs, then batches. */
export type Priority = Words<typeof PriorityNumber, "PRIORITY_">;

/** Parameters of any request. */
export interface CommonControls {
  options?: SolveOptions;
  /** Default: "realtime" of sessions, "batch" of batches, else "interactive". */
  priority?: Priority;
  /** The client's id of the request, for the server's log; at most 128 bytes of printable ASCII. */
  requestId?: string;
}

/** Parameters of a request besides its problem. All are optional. */
export interface RequestControls extends CommonControls {
  /** n entries. Default: the problem's x0, else the solver's choice. */
  initialPoint?: ArrayLike<number>;
  /** A solution of this problem or of a similar one with the same sizes. The solver tries its branch first. */
  warmStart?: Solution;
  /** Derivatives to compute with the solution, returned in `solution.sensitivity`. */
  sensitivity?: SensitivityRequest;
}

/** Parameters of a streamed solve. */
export interface StreamControls extends RequestControls, CallControls {
  /** Minimum time between two rows of progress, in seconds; default 0: every iteration. */
  progressIntervalS?: number;
  /** Attaches z to every k-th iteration's row if it is the newest when it is sent; default 0: never. */
  iterateEvery?: number;
}

/** Parameters of a solve. */
export interface SolveControls extends StreamControls {
  /** Called for every iteration, oldest first. If it throws, the solve is cancelled. */
  onProgress?: (row: Progress) => void;
}

/**
 * Events of a solve: accepted, queued (its position has changed), started, progress …, and last result, solved or not.
 */
export type SolveEvent =
  | { type: "accepted"; jobId: string; queuePosition: number; estimatedWaitS: number }
  | { type: "queued"; queuePosition: number; estimatedWaitS: number }
  | { type: "started"; queueS: number }
  /**
   * The iterations since the last such event, how many were dropped so far because they were not read fast enough, and
   * the current activity as text. While no iteration ends, an event without rows comes about twice a second.
   */
  | { type: "progress"; rows: Progress[]; skipped: number; activity: string }
  | { type: "result"; solution: Solution };

export async function solve(connection: Connection, problem: Problem, controls: SolveControls): Promise<Solution> {
  const { onProgress } = controls;
  if (onProgress === undefined) {
    const response = await unary(connection, SolverService.solve, solveRequest(problem, controls), controls);
    return new Solution(response.jobId, expect(response.solution));
  }
  for await (const event of solveStream(connection, problem, controls)) {
    if (event.type === "progress") event.rows.forEach(onProgress);
    if (event.type === "result") return event.solution;
  }
  throw withoutResult();
}

export async function* solveStream(
  connection: Connection,
  problem: Problem,
  controls: StreamControls,
): AsyncGenerator<SolveEvent, void, undefined> {
  const request = {
    solve: solveRequest(problem, controls),
    progressIntervalS: secondsOrZero("progressIntervalS", controls.progressIntervalS),
    iterateEvery: wholeOrZero("iterateEvery", controls.iterateEvery),
  };
  let skipped = 0;
  const messages = serverStream(connection, SolverService.solveStream, request, controls, connection.deadlineMs);
  for await (const message of messages) {
    const event = eventOf(message, skipped);
    if (event?.type === "progress") skipped = event.skipped;
    if (event !== undefined) yield event;
  }
}

/** Throws an InvalidProblemError before anything is sent. */
export function solveRequest(problem: Problem, controls: RequestControls): SolveRequest {
  const { message, shape } = checkProblem(problem);
  return {
    ...requestOf(message, controls),
    initialPoint: initialPoint(controls.initialPoint ?? problem.x0 ?? undefined, shape.variables),
    warmStart: controls.warmStart && warmStartOf(controls.warmStart),
    sensitivity: controls.sensitivity && sensitivityMessage(controls.sensitivity, shape),
  };
}

/** The same without the parts that depend on the problem's sizes. */
export function requestOf(problem: ProblemMessage | undefined, controls: CommonControls): SolveRequest {
  return {
    problem,
    options: optionsMessage(controls.options),
    initialPoint: undefined,
    warmStart: undefined,
    requestId: controls.requestId ?? "",
    priority: priorityOf(controls.priority),
    scenarios: undefined,
    coupled: undefined,
    sensitivity: undefined,
  };
}

export function initialPoint(z: ArrayLike<number> | undefined, n: number): { z: Uint8Array } | undefined {
  return z && { z: packDoubles(takeVector("initialPoint", z, n, "variables")) };
}

/** The fields of a solution that the message has. */
export function warmStartOf(solution: Solution): WarmStart {
  const start = WarmStart.fromPartial({});
  for (const name of Object.keys(start) as (keyof WarmStart)[]) {
    const value = solution[name];
    Object.assign(start, { [name]: typeof value === "number" ? value : packDoubles(value) });
  }
  return start;
}

export function priorityOf(priority: Priority | undefined): PriorityNumber {
  const value = valueOf(PriorityNumber, "PRIORITY_", priority);
  if (value !== undefined) return value;
  throw invalid("priority", `must be one of ${words(PriorityNumber, "PRIORITY_").join(", ")}`, { value: priority });
}

/** Returns a part that the contract guarantees. */
export function expect<T>(part: T | undefined): T {
  if (part === undefined) throw withoutResult();
  return part;
}

function withoutResult(): Error {
  return errorOf("internal", "the server ended the call without a result");
}

function eventOf({ event }: SolveStreamResponse, skipped: number): SolveEvent | undefined {
  switch (event?.$case) {
    case "accepted":
      return { type: "accepted", ...event.value };
    case "queued":
      return { type: "queued", ...event.value };
    case "started":
      return { type: "started", ...event.value };
    case "progress":
      return {
        type: "progress",
        rows: event.value.rows.map(progressOf),
        skipped: event.value.skipped,
        activity: event.value.activity?.text ?? "",
      };
    case "result":
      return { type: "result", solution: new Solution(event.value.jobId, expect(event.value.solution), skipped) };
    default:
      return undefined; // an event of a newer server
  }
}
