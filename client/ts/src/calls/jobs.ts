import { randomUUID } from "node:crypto";

import { secondsOrZero, wholeOrZero } from "../checks.js";
import { type MarbleError, RefusedError, invalid } from "../errors.js";
import { unpackDoubles, unpackFloats, unpackIntegers } from "../packed.js";
import { type Words, valueOf, word, words } from "../words.js";
import type { Connection } from "../connection/connection.js";
import {
  type GetJobResponse,
  type Infeasibility as InfeasibilityMessage,
  type JobEvent as JobEventMessage,
  type JobInfo as JobInfoMessage,
  JobKind as KindNumber,
  Priority as PriorityNumber,
  JobState as StateNumber,
  type Trace as TraceMessage,
} from "../generated/marble/v1/job.js";
import { JobsService, type SolveRequest, type SolveResponse, type SubmitResponse } from "../generated/marble/v1/service.js";
import { Status as StatusNumber } from "../generated/marble/v1/solution.js";
import { type SolveOptions, optionsOf } from "../model/options.js";
import type { Problem } from "../model/problem.js";
import { type Progress, type Tree, type Violations, progressOf, treeOf, violationsOf } from "../model/progress.js";
import { type Conflict, Solution, type Status, type Times, conflictOf, timesOf } from "../model/solution.js";
import {
  type ArrayAnswer,
  type ArrayControls,
  type ArrayElement,
  type ArrayReading,
  type SubmittedArray,
  arrayAnswers,
  arrayMessages,
} from "./array.js";
import { type CallControls, clientStream, deadlineOf, serverStream, unary } from "./calls.js";
import {
  type CoupledSolution,
  type CoupledBlock,
  type CoupledControls,
  type CoupledProblem,
  type Segments,
  type SegmentsAnswer,
  type SegmentsControls,
  coupledSolutionOf,
  coupledRequest,
  segmentsAnswerOf,
  segmentsRequest,
} from "./coupled.js";
import { type Limits, Patience, repeated } from "./patience.js";
import {
  type ScenarioSolution,
  type ScenarioControls,
  type SampleAverageStage,
  stageOf,
  messageOf,
  scenarioSolutionOf,
} from "./scenarios.js";
import { type Priority, type RequestControls, expect, solveRequest } from "./solve.js";
import { errorOfStatus } from "./status.js";

/** The kind of call that created a job. */
export type JobKind = Words<typeof KindNumber, "JOB_KIND_">;

/** The state of a job; "idle" is a session between updates. */
export type JobState = Words<typeof StateNumber, "JOB_STATE_">;

type WordFields = "sampleAverageStages" | "kind" | "state" | "priority" | "status" | "error" | "violations" | "times";
type TreeFields = "incumbent" | keyof Tree;

/** Information about one job, without its problem and the vectors of its solution. */
export interface JobInfo extends Omit<JobInfoMessage, WordFields | TreeFields>, Tree {
  kind?: JobKind;
  state?: JobState;
  priority?: Priority;
  /** Status of the solve; for a session, of its newest one. */
  status?: Status;
  /** Why there is no solution. */
  error?: MarbleError;
  violations: Violations;
  /** With option global_search, the objective of the best point so far; Infinity if there is none. */
  incumbent: number;
  times: Times;
  /** Stages of a problem with scenarios so far. */
  sampleAverageStages: SampleAverageStage[];
}

/** Both sides of all pairs at one iteration. */
export interface PairSides {
  iteration: number;
  kappa: number;
  /** L z + l. */
  s: Float32Array;
  /** R z + r. */
  t: Float32Array;
}

/** The iterations of a job, oldest first. A long job has every `stride`-th iteration and the newest. */
export interface Trace {
  rows: Progress[];
  stride: number;
  pairs: PairSides[];
}

/** Why a problem is infeasible, of bounded length; the job's solution has all of it. */
export interface Infeasibility extends Omit<InfeasibilityMessage, "conflict" | "rows" | "multipliers"> {
  /** With option explain, the solution's conflict with its first 100 parts in the order of its fields. */
  conflict?: Conflict;
  /**
   * Indices in the solution's certificate of its largest multipliers, at most 8, largest first; empty without a
   * certificate.
   */
  rows: Int32Array;
  /** The multipliers of these rows. */
  multipliers: Float64Array;
}

/** One job with its options and its convergence. */
export interface JobDetails extends Omit<GetJobResponse, "job" | "options" | "trace" | "infeasibility"> {
  job: JobInfo;
  options: SolveOptions;
  trace: Trace;
  /**
   * Why its problem is infeasible, also if the server does not keep the solution; absent for any other status. For a
   * session, of its newest solve.
   */
  infeasibility?: Infeasibility;
}

/** An accepted job. */
export interface SubmittedJob extends SubmitResponse {}

/** Which jobs to list; default: all. */
export interface JobQuery {
  states?: JobState[];
  client?: string;
  /** In [1, 10000]; default 100. */
  limit?: number;
  /** Lists only jobs older than this one, for the next page. */
  beforeJobId?: string;
}

/** Jobs, newest first. */
export interface JobPage {
  jobs: JobInfo[];
  /** Whether there are further jobs, for `beforeJobId`. */
  more: boolean;
}

/** The current state of a job, and its progress since the last event. */
export interface JobEvent {
  job: JobInfo;
  /** Every row if one job is watched; the newest row of each job if all are. */
  rows: Progress[];
  /** The job's iterations so far, in the first event if one job is watched. */
  trace?: Trace;
  /** The newest pairs if one job with few enough pairs is watched. */
  pairs?: PairSides;
  /** How many rows were dropped so far because the events were not read fast enough. */
  skipped: number;
}

/** Parameters of `jobs.result`. */
export interface ResultControls extends CallControls {
  /** Waits for the result; otherwise an unfinished job rejects with a PreconditionError. */
  wait?: boolean;
}

/** Parameters of `jobs.watch`. */
export interface WatchControls {
  /** Minimum time between two events of one job, in seconds; default 0. */
  progressIntervalS?: number;
  signal?: AbortSignal;
}

/**
 * Calls for jobs. A NotFoundError means that the job does not exist, is no longer kept, or belongs to another client.
 */
export class Jobs {
  /** @internal */
  constructor(private readonly connection: Connection) {}

  /**
   * Queues a job that outlives this process. If the queue or the client's share of it is full, waits for room until the
   * deadline, or for the client's `waitMs` if there is none. The deadline applies only to the submission. Submissions
   * with the same requestId are one job; the default is a random id.
   *
   * @throws RefusedError if there is no room in time; DeadlineError at the deadline.
   */
  async submit(problem: Problem, controls: RequestControls & CallControls = {}): Promise<SubmittedJob> {
    return this.send(solveRequest(problem, controls), controls);
  }

  /** The same for a problem with scenarios. */
  async submitScenarios(problem: Problem, controls: ScenarioControls): Promise<SubmittedJob> {
    return this.send({ ...solveRequest(problem, controls), scenarios: messageOf(controls) }, controls);
  }

  /** The same for problems that are coupled by rows. */
  async submitCoupled(problem: CoupledProblem, controls: CoupledControls = {}): Promise<SubmittedJob> {
    return this.send(coupledRequest(problem, controls), controls);
  }

  /** The same for a long problem in segments. */
  async submitSegments(problem: Problem, cut: Segments, controls: SegmentsControls = {}): Promise<SubmittedJob> {
    return this.send(segmentsRequest(problem, cut, controls), controls);
  }

  /**
   * Queues any number of problems as one job that outlives this process. All problems are checked before the first is
   * sent, and the server accepts all or none. Deadline and waiting are those of `submit`. `array` returns the results.
   */
  async submitArray(elements: Iterable<ArrayElement>, controls: ArrayControls = {}): Promise<SubmittedArray> {
    const messages = arrayMessages(elements, controls.requestId ?? `submit-${randomUUID()}`, controls);
    return this.waitForRoom(controls, (limits) =>
      repeated(this.connection, limits, () => clientStream(this.connection, JobsService.submitArray, messages, limits)),
    );
  }

  /**
   * The results of an array, each once: first the finished elements, then the others as they finish. A lost connection
   * is opened again. Throws the array's error if it ended before all elements had a result.
   */
  array(jobId: string, reading: ArrayReading = {}): AsyncGenerator<ArrayAnswer, void, undefined> {
    return arrayAnswers(this.connection, jobId, reading);
  }

  /** The solution of a submitted job; rejects with the error of a job that failed. */
  async result(jobId: string, controls: ResultControls = {}): Promise<Solution> {
    const response = await this.response(jobId, controls);
    return new Solution(response.jobId, expect(response.solution));
  }

  /** The solution of a job submitted with scenarios; rejects with a PreconditionError for other jobs. */
  async scenarios(jobId: string, controls: ResultControls = {}): Promise<ScenarioSolution> {
    return scenarioSolutionOf(await this.response(jobId, controls));
  }

  /** The same for coupled problems; `blocks` determines which variables belong to which block. */
  async coupled(jobId: string, blocks: CoupledBlock[], controls: ResultControls = {}): Promise<CoupledSolution> {
    return coupledSolutionOf(await this.response(jobId, controls), blocks);
  }

  /** The same for a problem in segments. */
  async segments(jobId: string, controls: ResultControls = {}): Promise<SegmentsAnswer> {
    return segmentsAnswerOf(await this.response(jobId, controls));
  }

  private async send(request: SolveRequest, controls: CallControls): Promise<SubmittedJob> {
    const named = { ...request, requestId: request.requestId || `submit-${randomUUID()}` };
    return this.waitForRoom(controls, ({ deadline, signal }) => {
      const deadlineMs = deadline && Math.max(deadline - Date.now(), 1);
      return unary(this.connection, JobsService.submit, named, { signal, deadlineMs });
    });
  }

  private async waitForRoom<Result>(
    controls: CallControls,
    attempt: (limits: Limits) => Promise<Result>,
  ): Promise<Result> {
    const { connection } = this;
    const { signal } = controls;
    const deadline = deadlineOf(controls, connection.deadlineMs);
    let patience: Patience | undefined;
    for (;;) {
      try {
        return await attempt({ deadline, signal });
      } catch (error) {
        if (!willHaveRoom(error)) throw error;
        patience ??= new Patience({ totalMs: deadline === undefined ? connection.waitMs : Infinity, deadline, signal });
        await patience.pause(error);
      }
    }
  }

  private async response(jobId: string, controls: ResultControls): Promise<SolveResponse> {
    return unary(this.connection, JobsService.result, { jobId, wait: controls.wait ?? false }, controls);
  }

  /** Deletes a submitted job and its result; cancels the job if it has not finished. */
  async delete(jobId: string, controls: CallControls = {}): Promise<void> {
    await unary(this.connection, JobsService.delete, { jobId }, controls);
  }

  async list(query: JobQuery = {}, controls: CallControls = {}): Promise<JobPage> {
    const request = {
      states: (query.states ?? []).map(stateNumber),
      client: query.client ?? "",
      limit: wholeOrZero("limit", query.limit),
      beforeJobId: query.beforeJobId ?? "",
    };
    const { jobs, more } = await unary(this.connection, JobsService.list, request, controls);
    return { jobs: jobs.map(infoOf), more };
  }

  /** One job with its options, its convergence and, if its problem is infeasible, the reason. */
  async get(jobId: string, controls: CallControls = {}): Promise<JobDetails> {
    const details = await unary(this.connection, JobsService.get, { jobId }, controls);
    return {
      job: infoOf(expect(details.job)),
      options: optionsOf(details.options),
      trace: traceOf(details.trace ?? { rows: [], stride: 1, pairs: [] }),
      infeasibility: details.infeasibility && infeasibilityOf(details.infeasibility),
    };
  }

  /** Cancels a job: at once if it waits, within one iteration if it runs. Returns its state. */
  async cancel(jobId: string, controls: CallControls = {}): Promise<JobInfo> {
    return infoOf(expect((await unary(this.connection, JobsService.cancel, { jobId }, controls)).job));
  }

  /** Events of one job until it has finished, or without an id, of all jobs. Leaving the loop ends the call. */
  async *watch(jobId = "", controls: WatchControls = {}): AsyncGenerator<JobEvent, void, undefined> {
    const request = { jobId, progressIntervalS: secondsOrZero("progressIntervalS", controls.progressIntervalS) };
    const { signal } = controls;
    for await (const { events, skipped } of serverStream(this.connection, JobsService.watch, request, { signal })) {
      for (const event of events) yield eventOf(event, skipped);
    }
  }
}

// For other limits the same request would be refused again, whatever the server's RetryInfo is.
function willHaveRoom(error: unknown): error is RefusedError {
  const ofQueue = ["queueJobs", "queueBytes", "clientQueued", "clientBytes"];
  return error instanceof RefusedError && error.retryAfterMs !== undefined && ofQueue.includes(error.field ?? "");
}

function infoOf(message: JobInfoMessage): JobInfo {
  return {
    ...message,
    kind: word(KindNumber, "JOB_KIND_", message.kind),
    state: word(StateNumber, "JOB_STATE_", message.state),
    priority: word(PriorityNumber, "PRIORITY_", message.priority),
    status: word(StatusNumber, "STATUS_", message.status),
    error: message.error && errorOfStatus(message.error),
    violations: violationsOf(message.violations),
    incumbent: message.incumbent ?? Infinity,
    ...treeOf(message),
    times: timesOf(message.times),
    sampleAverageStages: message.sampleAverageStages.map(stageOf),
  };
}

function eventOf(event: JobEventMessage, skipped: number): JobEvent {
  return {
    job: infoOf(expect(event.job)),
    rows: event.rows.map(progressOf),
    trace: event.trace && traceOf(event.trace),
    pairs: event.pairs && { ...event.pairs, s: unpackFloats(event.pairs.s), t: unpackFloats(event.pairs.t) },
    skipped,
  };
}

function infeasibilityOf(message: InfeasibilityMessage): Infeasibility {
  return {
    ...message,
    conflict: message.conflict && conflictOf(message.conflict),
    rows: unpackIntegers(message.rows),
    multipliers: unpackDoubles(message.multipliers),
  };
}

function traceOf({ rows, stride, pairs }: TraceMessage): Trace {
  return {
    rows: rows.map(progressOf),
    stride,
    pairs: pairs.map((sides) => ({ ...sides, s: unpackFloats(sides.s), t: unpackFloats(sides.t) })),
  };
}

function stateNumber(state: JobState): StateNumber {
  const value = valueOf(StateNumber, "JOB_STATE_", state);
  if (value !== undefined) return value;
  throw invalid("states", `must be one of ${words(StateNumber, "JOB_STATE_").join(", ")}`, { value: state });
}
