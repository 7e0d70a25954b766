import type { ClientDuplexStream } from "@grpc/grpc-js";

import { checkDeadline, secondsOrZero, untilForever, wholeOrZero } from "../base/checks.js";
import { type MarbleError, SupersededError, errorOf, invalid } from "../base/errors.js";
import type { Connection } from "../connection/connection.js";
import { SolverService } from "../generated/marble/v1/service.js";
import type {
  SessionReady,
  SessionRequest,
  SessionResponse,
  SessionUpdate,
  Shift as ShiftMessage,
} from "../generated/marble/v1/session.js";
import { type SolveOptions, optionsMessage } from "../model/options.js";
import { type Problem, type ProblemUpdate, type Shape, checkProblem, updateMessage } from "../model/problem.js";
import { type Progress, progressOf } from "../model/progress.js";
import { type SensitivityRequest, sensitivityMessage } from "../model/sensitivity.js";
import { Solution } from "../model/solution.js";
import { duplex, received } from "./calls.js";
import { type RequestControls, type StreamControls, expect, initialPoint, priorityOf } from "./solve.js";
import { errorOfCall, errorOfStatus } from "./status.js";

/** What holds for a session as a whole; all of it optional. */
export interface SessionControls
  extends Omit<RequestControls, "sensitivity">, Pick<StreamControls, "progressIntervalS" | "iterateEvery"> {
  /** An update that still waits when the next one comes is not solved: it ends with a SupersededError. */
  latestOnly?: boolean;
  /** Called for every iteration of every solve, with the number of its update. */
  onProgress?: (row: Progress, sequence: number) => void;
  /** Gives the whole session up. */
  signal?: AbortSignal;
}

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
  /** No answer is wanted later than this after the update's arrival, in milliseconds > 0: it then ends with a DeadlineError. */
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

interface Waiting {
  resolve(solution: Solution): void;
  reject(error: MarbleError): void;
}

type Call = ClientDuplexStream<SessionRequest, SessionResponse>;

/**
 * One problem again and again with new numbers: set up once on the server, every solve starts from the last solution.
 * From `client.session()`. An error of an update is that update's alone, unless `isOpen` is false afterwards.
 */
export class Session implements AsyncDisposable {
  /** One job for all its solves. */
  readonly jobId: string;
  /** As it is counted against the server's limits. */
  readonly memoryBytes: number;
  /** What scaling, ordering, analysis and allocation took. */
  readonly setupS: number;
  /** Without an update for this long the server ends it. */
  readonly idleTimeoutS: number;

  private readonly waiting = new Map<number, Waiting>();
  private readonly finished: Promise<void>;
  private readonly firstParts = new Set<number>();
  private refusedPart?: { sequence: number; error: MarbleError };
  private sequence = 0;
  private end?: MarbleError;

  private constructor(
    private readonly call: Call,
    private readonly shape: Shape,
    private readonly onProgress: SessionControls["onProgress"],
    ready: SessionReady,
    events: AsyncGenerator<SessionResponse>,
  ) {
    this.jobId = ready.jobId;
    this.memoryBytes = ready.memoryBytes;
    this.setupS = ready.setupS;
    this.idleTimeoutS = ready.idleTimeoutS;
    this.finished = this.listen(events);
  }

  /** @internal */
  static async open(connection: Connection, problem: Problem, controls: SessionControls): Promise<Session> {
    const { message, shape } = checkProblem(problem);
    const setup = {
      problem: message,
      options: optionsMessage(controls.options),
      initialPoint: initialPoint(controls.initialPoint ?? problem.x0 ?? undefined, shape.variables),
      requestId: controls.requestId ?? "",
      priority: priorityOf(controls.priority),
      latestOnly: controls.latestOnly ?? false,
      progress: controls.onProgress !== undefined,
      progressIntervalS: secondsOrZero("progressIntervalS", controls.progressIntervalS),
      iterateEvery: wholeOrZero("iterateEvery", controls.iterateEvery),
    };
    const call = duplex(connection, SolverService.session, controls.signal);
    const events = received(call, controls.signal);
    call.write({ request: { $case: "setup", value: setup } });
    const first = await events.next();
    if (first.done || first.value.event?.$case !== "ready") {
      call.cancel();
      throw errorOf("internal", "the server did not set the session up");
    }
    return new Session(call, shape, controls.onProgress, first.value.event.value, events);
  }

  /** False once it was closed, given up, or ended by the server. */
  get isOpen(): boolean {
    return this.end === undefined;
  }

  /** Solves with new numbers, or as things are. Several may wait, here if not at the server; they are solved in their order. */
  async update(update: ProblemUpdate = {}, controls: UpdateControls = {}): Promise<Solution> {
    const message = updateOf(this.sequence + 1, update, controls, this.shape);
    if (this.end !== undefined) throw this.end;
    const sequence = ++this.sequence;
    return new Promise((resolve, reject) => {
      this.waiting.set(sequence, { resolve, reject });
      this.call.write({ request: { $case: "update", value: message } });
    });
  }

  /**
   * Sends the first part of an update ahead of what is not known yet: the next update is the second part, and its solution
   * that of one update of both, to the last bit. The server takes the numbers in and factorizes for the branch that the
   * solve will begin on; nothing is answered. What it refuses of a first part rejects the update that follows.
   * @throws InvalidProblemError of a part that does not fit.
   */
  prepare(update: ProblemUpdate = {}, controls: Omit<UpdateControls, "deadlineMs" | "sensitivity"> = {}): void {
    const message = { ...updateOf(this.sequence + 1, update, controls, this.shape), prepare: true };
    if (this.end !== undefined) throw this.end;
    this.firstParts.add(++this.sequence);
    this.call.write({ request: { $case: "update", value: message } });
  }

  /** Ends the session once everything is answered, and waits for that. */
  async close(): Promise<void> {
    if (this.end === undefined) {
      this.end = ended();
      this.call.end();
    }
    await this.finished;
  }

  /** Gives up what is not answered. */
  abandon(): void {
    this.call.cancel();
  }

  /** As `close`, at the end of an `await using` block. */
  async [Symbol.asyncDispose](): Promise<void> {
    await this.close();
  }

  private async listen(events: AsyncGenerator<SessionResponse>): Promise<void> {
    try {
      for await (const { event } of events) if (event !== undefined) this.take(event);
      this.end ??= ended();
    } catch (error) {
      this.end = errorOfCall(error);
    }
    for (const { reject } of this.waiting.values()) reject(this.end);
    this.waiting.clear();
    this.call.cancel();
  }

  private take(event: NonNullable<SessionResponse["event"]>): void {
    const { value } = event;
    if (event.$case === "ready") return;
    if (event.$case === "progress") {
      for (const row of expect(event.value.progress).rows) this.onProgress?.(progressOf(row), event.value.sequence);
      return;
    }
    const sequence = (value as { sequence: number }).sequence;
    if (this.firstParts.delete(sequence)) {
      // An answer to one is an older server's, and of no use.
      if (event.$case === "error") this.refusedPart = { sequence, error: errorOfStatus(expect(event.value.status)) };
      return;
    }
    for (const part of this.firstParts) if (part < sequence && event.$case === "answer") this.firstParts.delete(part);
    const waiting = this.waiting.get(sequence);
    this.waiting.delete(sequence);
    if (this.refusedPart !== undefined && this.refusedPart.sequence < sequence) {
      waiting?.reject(this.refusedPart.error);
      this.refusedPart = undefined;
      return;
    }
    if (event.$case === "answer") waiting?.resolve(new Solution(this.jobId, expect(event.value.solution)));
    if (event.$case === "superseded") waiting?.reject(new SupersededError(event.value.bySequence));
    if (event.$case === "error") waiting?.reject(errorOfStatus(expect(event.value.status)));
  }
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

function updateOf(sequence: number, update: ProblemUpdate, controls: UpdateControls, shape: Shape): SessionUpdate {
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

function ended(): MarbleError {
  return errorOf("failed_precondition", "the session has ended");
}
