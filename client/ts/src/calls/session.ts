import { checkDeadline, secondsOrZero, wholeOrZero } from "../base/checks.js";
import {
  InvalidProblemError,
  type MarbleError,
  PreconditionError,
  RefusedError,
  SupersededError,
  errorOf,
} from "../base/errors.js";
import type { Connection } from "../connection/connection.js";
import type { SessionAnswer, SessionReady, SessionSuperseded, SessionUpdate } from "../generated/marble/v1/session.js";
import { optionsMessage } from "../model/options.js";
import { type Problem, type ProblemUpdate, type Shape, checkProblem } from "../model/problem.js";
import { type Progress, progressOf } from "../model/progress.js";
import { Solution } from "../model/solution.js";
import { Patience, repeated } from "./patience.js";
import { SessionMemory } from "./session-memory.js";
import { type SessionEvent, SessionStream } from "./session-stream.js";
import { type UpdateControls, updateOf } from "./session-update.js";
import { type RequestControls, type StreamControls, expect, initialPoint, priorityOf } from "./solve.js";
import { cancelled, errorOfCall, errorOfStatus, isLost } from "./status.js";

const reopenMs = 10_000;
/** So that a last try is one. */
const shortestTryMs = 1000;
const longestTimerMs = 2 ** 31 - 1;

/** What holds for a session as a whole; all of it optional. */
export interface SessionControls
  extends Omit<RequestControls, "sensitivity">, Pick<StreamControls, "progressIntervalS" | "iterateEvery"> {
  /** An update that still waits when the next one comes is not solved: it ends with a SupersededError. */
  latestOnly?: boolean;
  /** Called for every iteration of every solve, with the number of its update. */
  onProgress?: (row: Progress, sequence: number) => void;
  /** Gives the whole session up. */
  signal?: AbortSignal;
  /**
   * Where the server is lost or drains, what is not answered yet, or else the next update, opens the session again: on
   * another server where the address has several, with all numbers and options as they are by then, and from the last
   * solution's z, moved on as the update says, without its multipliers. Default false: a loss is the session's end.
   */
  reopen?: boolean;
  /** How long that is tried, with the set-up, in milliseconds > 0; then an UnavailableError is its end. Default 10,000. */
  reopenMs?: number;
  /** Called once for each time that it was reopened; what it throws ends the session. */
  onReopen?: (reopening: Reopening) => void;
}

/** That a session goes on elsewhere, or there again. */
export interface Reopening {
  /** The session's number among those that were opened one for the other: 1 after the first loss, then 2 … */
  epoch: number;
  /** The job of all its solves from here on. */
  jobId: string;
  /** How the one before was lost. */
  cause: MarbleError;
}

interface Sent {
  message: SessionUpdate;
  /** Of a first part there is none. */
  waiting?: Waiting;
}

interface Waiting {
  resolve(solution: Solution): void;
  reject(error: MarbleError): void;
  /** Until when it waits for a server, as performance.now() tells it. */
  until: number;
}

/**
 * One problem again and again with new numbers: set up once on the server, every solve starts from the last solution.
 * From `client.session()`. An error of an update is that update's alone, unless `isOpen` is false afterwards.
 */
export class Session implements AsyncDisposable {
  private ready: SessionReady;
  // What has no outcome yet, in the order of sending.
  private readonly sent = new Map<number, Sent>();
  private readonly finished: Promise<void>;
  private readonly given = new AbortController();
  private refusedPart?: { sequence: number; error: MarbleError };
  private sequence = 0;
  private end?: MarbleError;
  private epoch = 0;
  private restartsTold = 0;
  private wake: () => void = () => undefined;
  private lostCause?: MarbleError; // while there is no server

  private constructor(
    private readonly connection: Connection,
    private readonly shape: Shape,
    private readonly controls: SessionControls,
    private readonly memory: SessionMemory | undefined,
    private stream: SessionStream | undefined,
    ready: SessionReady,
  ) {
    this.ready = ready;
    this.finished = this.run();
  }

  /** @internal */
  static async open(connection: Connection, problem: Problem, controls: SessionControls): Promise<Session> {
    const { message, shape } = checkProblem(problem);
    checkDeadline("reopenMs", controls.reopenMs);
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
      epoch: 0,
    };
    const { signal } = controls;
    const stream = await repeated(connection, { signal }, () => SessionStream.open(connection, setup, signal));
    const memory = controls.reopen ? new SessionMemory(setup, shape.matrices.Q) : undefined;
    return new Session(connection, shape, controls, memory, stream, stream.ready);
  }

  /** One job for all its solves; another one once it was reopened. */
  get jobId(): string {
    return this.ready.jobId;
  }

  /** As it is counted against the server's limits, in bytes. */
  get memoryBytes(): number {
    return this.ready.memoryBytes;
  }

  /** What scaling, ordering, analysis and allocation took, in seconds. */
  get setupS(): number {
    return this.ready.setupS;
  }

  /** Without an update for this long, in seconds, the server ends it. */
  get idleTimeoutS(): number {
    return this.ready.idleTimeoutS;
  }

  /** How often it was reopened. */
  get reopened(): number {
    return this.epoch;
  }

  /** How often the server has begun it anew by itself, after many updates in a row that ran out of time. */
  get restarts(): number {
    return this.restartsTold;
  }

  /** False once it was closed, given up, or ended by the server; of one that may be reopened, if that failed. */
  get isOpen(): boolean {
    return this.end === undefined;
  }

  /**
   * Solves with new numbers, or as things are. Several may wait, here if not at the server; they are solved in their
   * order. With `reopen` an update that a lost server has not answered is solved by the next one, and its deadline
   * begins anew there; but it waits for that server no longer than `deadlineMs` from the call on: then it rejects with an
   * UnavailableError, its numbers stay, and the session goes on.
   */
  async update(update: ProblemUpdate = {}, controls: UpdateControls = {}): Promise<Solution> {
    const message = updateOf(this.sequence + 1, update, controls, this.shape);
    if (this.end !== undefined) throw this.end;
    return new Promise((resolve, reject) => {
      const waiting = { resolve, reject, until: performance.now() + (controls.deadlineMs ?? Infinity) };
      this.send({ message, waiting: this.memory === undefined ? waiting : this.timed(waiting, controls.deadlineMs) });
    });
  }

  // As long as there is a server, it tells that the deadline has passed.
  private timed(waiting: Waiting, deadlineMs: number | undefined): Waiting {
    if (deadlineMs === undefined || deadlineMs > longestTimerMs) return waiting;
    // A millisecond more: a timer may fire a little early, and there is no second one.
    const timer = setTimeout(() => this.lostCause && this.giveUpLate(this.lostCause), Math.ceil(deadlineMs) + 1);
    const before =
      <Told>(tell: (told: Told) => void) =>
      (told: Told): void => {
        clearTimeout(timer);
        tell(told);
      };
    return { ...waiting, resolve: before(waiting.resolve), reject: before(waiting.reject) };
  }

  // Updates whose deadline has passed while there is no server: their numbers are for the next one.
  private giveUpLate(cause: MarbleError): void {
    for (const [sequence, { message, waiting }] of this.sent) {
      if (waiting === undefined || performance.now() < waiting.until) continue;
      this.leaveToNext(sequence, message);
      waiting.reject(errorOf("unavailable", `the deadline passed while the server was lost: ${cause.message}`, { cause }));
    }
  }

  /**
   * Sends the first part of an update ahead of what is not known yet: the next update is the second part, and its
   * solution that of one update of both, to the last bit. The server takes the numbers in and factorizes for the branch
   * that the solve will begin on; nothing is answered. What it refuses of a first part rejects the update that follows.
   * @throws InvalidProblemError of a part that does not fit.
   */
  prepare(update: ProblemUpdate = {}, controls: Omit<UpdateControls, "deadlineMs" | "sensitivity"> = {}): void {
    const message = { ...updateOf(this.sequence + 1, update, controls, this.shape), prepare: true };
    if (this.end !== undefined) throw this.end;
    this.send({ message });
  }

  /** Ends the session once everything is answered, and waits for that. */
  async close(): Promise<void> {
    if (this.end === undefined) {
      this.end = ended();
      this.stream?.end();
      this.wake();
    }
    await this.finished;
  }

  /** As `close`, at the end of an `await using` block. */
  async [Symbol.asyncDispose](): Promise<void> {
    await this.close();
  }

  private send(sent: Sent): void {
    this.sent.set(++this.sequence, sent);
    this.stream?.send(sent.message);
    this.wake();
  }

  private get anyWaits(): boolean {
    return [...this.sent.values()].some(({ waiting }) => waiting !== undefined);
  }

  // From server to server, until it is over.
  private async run(): Promise<void> {
    const { signal } = this.controls;
    const giveUp = (): void => this.given.abort(signal?.reason);
    signal?.addEventListener("abort", giveUp, { once: true });
    this.given.signal.addEventListener("abort", () => (this.stream?.cancel(), this.wake()), { once: true });
    try {
      for (let cause = await this.listen(); cause !== undefined; cause = await this.listen()) await this.reopen(cause);
      this.end ??= ended();
    } catch (error) {
      this.end = errorOfCall(error);
    }
    signal?.removeEventListener("abort", giveUp);
    this.stream?.cancel();
    this.stream = undefined;
    for (const { waiting } of this.sent.values()) waiting?.reject(this.end);
    this.sent.clear();
  }

  // Until the server ends the session. Gives why, if it is to be reopened; throws why, if not.
  private async listen(): Promise<MarbleError | undefined> {
    try {
      for await (const event of this.stream?.events() ?? []) this.take(event);
      return undefined;
    } catch (error) {
      if (this.given.signal.aborted) throw cancelled(this.given.signal);
      if (this.memory === undefined || !isLost(error)) throw error;
      this.stream = undefined;
      this.lostCause = error;
      this.giveUpLate(error);
      while (this.sent.size === 0 && this.end === undefined && !this.given.signal.aborted) {
        await new Promise<void>((wake) => (this.wake = wake));
      }
      if (this.given.signal.aborted) throw cancelled(this.given.signal);
      return this.anyWaits || this.end === undefined ? error : undefined;
    }
  }

  private async reopen(cause: MarbleError): Promise<void> {
    const totalMs = this.controls.reopenMs ?? reopenMs;
    const { signal } = this.given;
    const end = performance.now() + totalMs;
    const patience = new Patience({ totalMs, signal });
    let stream: SessionStream | undefined;
    while (stream === undefined) {
      const unanswered = [...this.sent.values()].map(({ message }) => message);
      const setup = expect(this.memory).setupFor(unanswered, this.epoch + 1);
      try {
        const withinMs = Math.max(shortestTryMs, end - performance.now());
        stream = await SessionStream.open(this.connection, setup, signal, withinMs);
      } catch (error) {
        // The place that it had may not have been given back yet.
        if (!isLost(error) && !(error instanceof RefusedError)) throw error;
        await patience.pause(error);
      }
    }
    this.epoch += 1;
    this.restartsTold = 0;
    this.ready = stream.ready;
    this.stream = stream;
    this.lostCause = undefined;
    if (signal.aborted) throw cancelled(signal);
    for (const { message } of this.sent.values()) stream.send(message);
    if (this.end !== undefined) stream.end();
    this.controls.onReopen?.({ epoch: this.epoch, jobId: this.jobId, cause });
  }

  private take(event: SessionEvent): void {
    if (event.$case === "progress") {
      const { progress, sequence } = event.value;
      for (const row of expect(progress).rows) this.controls.onProgress?.(progressOf(row), sequence);
      return;
    }
    const { sequence } = event.value;
    const sent = this.sent.get(sequence);
    const error = event.$case === "error" ? errorOfStatus(expect(event.value.status)) : undefined;
    // A server that drains has not taken it; the next one will.
    if (sent === undefined || (this.memory !== undefined && isLost(error))) return;
    if (sent.waiting === undefined) {
      // An answer to a first part is an older server's, and of no use.
      if (error === undefined) return;
      this.sent.delete(sequence);
      this.refusedPart = { sequence, error };
      return;
    }
    if (event.$case === "superseded") this.leaveToNext(sequence, sent.message);
    else this.settle(sequence, error);
    const solution = event.$case === "answer" ? this.answered(event.value) : undefined;
    if (this.refusedPart !== undefined && this.refusedPart.sequence < sequence) {
      sent.waiting.reject(this.refusedPart.error);
      this.refusedPart = undefined;
    } else if (solution !== undefined) {
      sent.waiting.resolve(solution);
    } else {
      sent.waiting.reject(error ?? new SupersededError((event.value as SessionSuperseded).bySequence));
    }
  }

  // The one that took its place took its numbers along, and is not answered yet: as a first part would.
  private leaveToNext(sequence: number, message: SessionUpdate): void {
    if (this.memory === undefined) this.sent.delete(sequence);
    else this.sent.set(sequence, { message: { ...message, prepare: true, deadlineS: 0, sensitivity: undefined } });
  }

  // It has an outcome, with the first parts before it. Nothing of an invalid one was taken.
  private settle(sequence: number, error: MarbleError | undefined): void {
    const invalid = error instanceof InvalidProblemError || error instanceof PreconditionError;
    for (const [number, { message, waiting }] of this.sent) {
      if (number > sequence) break;
      if (number < sequence && (invalid || waiting !== undefined)) continue;
      this.sent.delete(number);
      if (!invalid) this.memory?.take(message);
    }
  }

  private answered({ solution, restarts }: SessionAnswer): Solution {
    const message = expect(solution);
    const answer = new Solution(this.jobId, message);
    if (restarts > this.restartsTold) this.memory?.startFrom(undefined);
    else if (answer.solved) this.memory?.startFrom(message.z);
    this.restartsTold = restarts;
    return answer;
  }
}

function ended(): MarbleError {
  return errorOf("failed_precondition", "the session has ended");
}
