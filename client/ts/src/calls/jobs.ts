import { randomUUID } from "node:crypto";

import { secondsOrZero, wholeOrZero } from "../base/checks.js";
import { type MarbleError, RefusedError, invalid } from "../base/errors.js";
import { unpackFloats } from "../base/packed.js";
import { type Words, valueOf, word, words } from "../base/words.js";
import type { Connection } from "../connection/connection.js";
import {
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
import { Solution, type Status, type Times, timesOf } from "../model/solution.js";
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
  type CoupledAnswer,
  type CoupledBlock,
  type CoupledControls,
  type CoupledProblem,
  type Pieces,
  type PiecesAnswer,
  type PiecesControls,
  coupledAnswerOf,
  coupledRequest,
  piecesAnswerOf,
  piecesRequest,
} from "./coupled.js";
import { type Limits, Patience, repeated } from "./patience.js";
import {
  type ScenarioAnswer,
  type ScenarioControls,
  type ScenarioLevel,
  levelOf,
  messageOf,
  scenarioAnswerOf,
} from "./scenarios.js";
import { type Priority, type RequestControls, expect, solveRequest } from "./solve.js";
import { errorOfStatus } from "./status.js";

/** What a job came by. */
export type JobKind = Words<typeof KindNumber, "JOB_KIND_">;

/** Where a job is in its life; "idle" is a session between updates. */
export type JobState = Words<typeof StateNumber, "JOB_STATE_">;

type WordFields = "scenarioLevels" | "kind" | "state" | "priority" | "status" | "error" | "violations" | "times";
type TreeFields = "incumbent" | keyof Tree;

/** What is known of one job, without its problem and its solution's vectors. */
export interface JobInfo extends Omit<JobInfoMessage, WordFields | TreeFields>, Tree {
  kind?: JobKind;
  state?: JobState;
  priority?: Priority;
  /** How the solve ended; of a session, the newest one. */
  status?: Status;
  /** Why there is no answer. */
  error?: MarbleError;
  violations: Violations;
  /** Of option global: objective of the best point so far; Infinity while there is none. */
  incumbent: number;
  times: Times;
  /** Of a scenario solve, so far. */
  scenarioLevels: ScenarioLevel[];
}

/** The two sides of all pairs at one iteration. */
export interface PairSides {
  iteration: number;
  kappa: number;
  /** L z + l. */
  s: Float32Array;
  /** R z + r. */
  t: Float32Array;
}

/** What a job did, oldest first; of a long one every `stride`-th iteration and the newest. */
export interface Trace {
  rows: Progress[];
  stride: number;
  pairs: PairSides[];
}

/** One job with the options in force and its convergence. */
export interface JobDetails {
  job: JobInfo;
  options: SolveOptions;
  trace: Trace;
}

/** A job that was taken in. */
export interface SubmittedJob extends SubmitResponse {}

/** Which jobs to list; all if nothing is said. */
export interface JobQuery {
  states?: JobState[];
  client?: string;
  /** In [1, 10000]; default 100. */
  limit?: number;
  /** To page on: only jobs older than this one. */
  beforeJobId?: string;
}

/** Jobs, newest first. */
export interface JobPage {
  jobs: JobInfo[];
  /** Go on with `beforeJobId`. */
  more: boolean;
}

/** A job as it is now, and what it did since it was last told of. */
export interface JobEvent {
  job: JobInfo;
  /** Of one job every row, of all jobs the newest of each. */
  rows: Progress[];
  /** In the first event of one job: what it did until now. */
  trace?: Trace;
  /** Of one job with few enough pairs: its newest. */
  pairs?: PairSides;
  /** What was not told so far, because the events were not taken fast enough. */
  skipped: number;
}

/** What may accompany `jobs.result`. */
export interface ResultControls extends CallControls {
  /** Wait for the answer; else an unfinished job is a PreconditionError. */
  wait?: boolean;
}

/** What may accompany `jobs.watch`. */
export interface WatchControls {
  /** Least time between two events about one job's progress, in seconds; default 0. */
  progressIntervalS?: number;
  signal?: AbortSignal;
}

/** Jobs by their ids. A NotFoundError is a job never heard of, no longer kept, or not the caller's to see. */
export class Jobs {
  /** @internal */
  constructor(private readonly connection: Connection) {}

  /**
   * Queues a job that outlives this process. A deadline is that of the submission alone: until then, or without one for
   * the client's `waitMs`, it waits for room where the queue or the client's share of it is full. The same submission
   * made again with its requestId is the same job; without one it has a random one.
   *
   * @throws RefusedError where there is no room in time, a DeadlineError at the deadline.
   */
  async submit(problem: Problem, controls: RequestControls & CallControls = {}): Promise<SubmittedJob> {
    return this.send(solveRequest(problem, controls), controls);
  }

  /** The same of one plan for many worlds. */
  async submitScenarios(problem: Problem, controls: ScenarioControls): Promise<SubmittedJob> {
    return this.send({ ...solveRequest(problem, controls), scenarios: messageOf(controls) }, controls);
  }

  /** The same of problems that rows tie together. */
  async submitCoupled(problem: CoupledProblem, controls: CoupledControls = {}): Promise<SubmittedJob> {
    return this.send(coupledRequest(problem, controls), controls);
  }

  /** The same of a long problem in pieces. */
  async submitPieces(problem: Problem, cut: Pieces, controls: PiecesControls = {}): Promise<SubmittedJob> {
    return this.send(piecesRequest(problem, cut, controls), controls);
  }

  /**
   * Queues many problems as one job that outlives this process, for more than a batch may wait for. All are checked
   * before the first is sent, and all are kept or none is; of the time it takes as `submit`. `array` tells the answers.
   */
  async submitArray(elements: Iterable<ArrayElement>, controls: ArrayControls = {}): Promise<SubmittedArray> {
    const messages = arrayMessages(elements, controls.requestId ?? `submit-${randomUUID()}`, controls);
    return this.whenThereIsRoom(controls, (limits) =>
      repeated(this.connection, limits, () => clientStream(this.connection, JobsService.submitArray, messages, limits)),
    );
  }

  /**
   * The answers of an array, each once: those that are there, and each of the others as it comes. A connection that is
   * lost meanwhile is made again. Throws what the array ended with, if that was before all elements had an answer.
   */
  array(jobId: string, reading: ArrayReading = {}): AsyncGenerator<ArrayAnswer, void, undefined> {
    return arrayAnswers(this.connection, jobId, reading);
  }

  /** The answer of a submitted job, or the error it ended with. */
  async result(jobId: string, controls: ResultControls = {}): Promise<Solution> {
    const answer = await this.answer(jobId, controls);
    return new Solution(answer.jobId, expect(answer.solution));
  }

  /** The answer of a job that was submitted with scenarios; a PreconditionError of others. */
  async scenarios(jobId: string, controls: ResultControls = {}): Promise<ScenarioAnswer> {
    return scenarioAnswerOf(await this.answer(jobId, controls));
  }

  /** The same of coupled problems, whose blocks' sizes say whose numbers are whose. */
  async coupled(jobId: string, blocks: CoupledBlock[], controls: ResultControls = {}): Promise<CoupledAnswer> {
    return coupledAnswerOf(await this.answer(jobId, controls), blocks);
  }

  /** The same of a problem in pieces. */
  async pieces(jobId: string, controls: ResultControls = {}): Promise<PiecesAnswer> {
    return piecesAnswerOf(await this.answer(jobId, controls));
  }

  private async send(request: SolveRequest, controls: CallControls): Promise<SubmittedJob> {
    const named = { ...request, requestId: request.requestId || `submit-${randomUUID()}` };
    return this.whenThereIsRoom(controls, ({ deadline, signal }) => {
      const deadlineMs = deadline && Math.max(deadline - Date.now(), 1);
      return unary(this.connection, JobsService.submit, named, { signal, deadlineMs });
    });
  }

  private async whenThereIsRoom<Result>(
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

  private async answer(jobId: string, controls: ResultControls): Promise<SolveResponse> {
    return unary(this.connection, JobsService.result, { jobId, wait: controls.wait ?? false }, controls);
  }

  /** Lets a submitted job and its answer go; ends it if it has not finished. */
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

  async get(jobId: string, controls: CallControls = {}): Promise<JobDetails> {
    const details = await unary(this.connection, JobsService.get, { jobId }, controls);
    return {
      job: infoOf(expect(details.job)),
      options: optionsOf(details.options),
      trace: traceOf(details.trace ?? { rows: [], stride: 1, pairs: [] }),
    };
  }

  /** Ends a job: a waiting one at once, a running one within an iteration. Gives it as it is then. */
  async cancel(jobId: string, controls: CallControls = {}): Promise<JobInfo> {
    return infoOf(expect((await unary(this.connection, JobsService.cancel, { jobId }, controls)).job));
  }

  /** Of one job what happens until it has finished; without an id of all jobs, for ever. Leaving the loop ends it. */
  async *watch(jobId = "", controls: WatchControls = {}): AsyncGenerator<JobEvent, void, undefined> {
    const request = { jobId, progressIntervalS: secondsOrZero("progressIntervalS", controls.progressIntervalS) };
    const { signal } = controls;
    for await (const { events, skipped } of serverStream(this.connection, JobsService.watch, request, { signal })) {
      for (const event of events) yield eventOf(event, skipped);
    }
  }
}

// Of other limits a server's RetryInfo says nothing: the same request breaks them again.
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
    scenarioLevels: message.scenarioLevels.map(levelOf),
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
