import { checkDeadline, secondsOrZero, wholeOrZero } from "../checks.js";
import {
  InvalidProblemError,
  type MarbleError,
  PreconditionError,
  RefusedError,
  SupersededError,
  errorOf,
  invalid,
} from "../errors.js";
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
import { cancelled, errorOfCall, errorOfStatus, isLost, lost } from "./status.js";

const reopenMs = 10_000;
/** Minimum time for an attempt. */
const shortestAttemptMs = 1000;
const longestTimerMs = 2 ** 31 - 1;
const answerGraceMs = 100;
const longestGraceMs = 3_600_000;
/** Updates in a row that a server may leave unanswered beyond their deadlines. */
const mostMisses = 20;

/** Parameters of a whole session. All are optional. */
export interface SessionControls
  extends Omit<RequestControls, "sensitivity">, Pick<StreamControls, "progressIntervalS" | "iterateEvery"> {
  /** An update that is still waiting when the next one arrives is not solved: it rejects with a SupersededError. */
  latestOnly?: boolean;
  /** Called for every iteration of every solve, with the number of its update. */
  onProgress?: (row: Progress, sequence: number) => void;
  /** Cancels the whole session. */
  signal?: AbortSignal;
  /**
   * If the server is lost or drains, open the session again, for unfinished updates or else for the next one; on
   * another server if the address has several. The reopened session has all current data and options. It starts from
   * the z of the last solution, shifted as the update specifies, without its multipliers. Default false: a loss ends
   * the session.
   */
  reopen?: boolean;
  /** Time limit of reopening, in milliseconds > 0; then the session ends with an UnavailableError. Default 10,000. */
  reopenMs?: number;
  /**
   * How long an update waits for an answer after its deadline, in milliseconds in [0, 3,600,000]: the way of an answer,
   * which the server sends before the deadline. Default 100.
   */
  answerGraceMs?: number;
  /** Called once for each reopening. If it throws, the session ends. */
  onReopen?: (reopening: Reopening) => void;
}

/** One reopening of a session, on another server or on the same one. */
export interface Reopening {
  /** The number of losses so far: 1 after the first one. */
  epoch: number;
  /** The job of all solves from now on. */
  jobId: string;
  /** Why the previous session was lost. */
  cause: MarbleError;
}

interface Sent {
  message: SessionUpdate;
  /** Absent for the first part of an update. */
  waiting?: Waiting;
  /** An update whose result is discarded. */
  givenUp?: boolean;
}

interface Waiting {
  resolve(solution: Solution): void;
  reject(error: MarbleError): void;
  /** Until when it waits for a server, in the time of performance.now(). */
  until: number;
}

/**
 * One problem, solved repeatedly with new data. It is set up once on the server, and every solve starts from the last
 * solution. Created by `client.session()`. An error of an update concerns only that update, unless `isOpen` is false
 * afterwards.
 */
export class Session implements AsyncDisposable {
  private ready: SessionReady;
  // Updates without a result, in the order of sending.
  private readonly sent = new Map<number, Sent>();
  private readonly finished: Promise<void>;
  private readonly aborter = new AbortController();
  private refusedPart?: { sequence: number; error: MarbleError };
  private sequence = 0;
  private end?: MarbleError;
  private epoch = 0;
  private restartsSeen = 0;
  private wake: () => void = () => undefined;
  private lostCause?: MarbleError; // while there is no server
  private misses = 0; // updates in a row that were not answered in time
  private lastMissed = false; // no result has come since
  private hung?: MarbleError; // why the stream was given up

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
    const grace = controls.answerGraceMs ?? answerGraceMs;
    if (!(typeof grace === "number" && grace >= 0 && grace <= longestGraceMs))
      throw invalid("answerGraceMs", `must be in [0, ${longestGraceMs}]`, { value: grace });
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

  /** The job of all solves; it changes when the session is reopened. */
  get jobId(): string {
    return this.ready.jobId;
  }

  /** Memory that counts towards the server's limits, in bytes. */
  get memoryBytes(): number {
    return this.ready.memoryBytes;
  }

  /** Time for scaling, ordering, analysis and allocation, in seconds. */
  get setupS(): number {
    return this.ready.setupS;
  }

  /** The server ends the session after this time without an update, in seconds. */
  get idleTimeoutS(): number {
    return this.ready.idleTimeoutS;
  }

  /** The number of reopenings. */
  get reopened(): number {
    return this.epoch;
  }

  /** How often the server discarded the session's history, after many updates in a row that ran out of time. */
  get restarts(): number {
    return this.restartsSeen;
  }

  /** False once the session was closed, cancelled or ended by the server, or once reopening has failed. */
  get isOpen(): boolean {
    return this.end === undefined;
  }

  /**
   * Solves with new data, or with the current data. Several updates may wait; they are solved in their order. With
   * `reopen` the next server solves the unfinished updates of a lost one, and their deadlines start again there. An
   * update waits for that server at most `deadlineMs` from the call: then it rejects with an UnavailableError, its data
   * take effect with the next update, and the session continues. If a server is silent, as one that hangs, the update
   * rejects with a DeadlineError `answerGraceMs` after its deadline, and a later answer is discarded; after 20 such
   * updates in a row the server counts as lost.
   */
  async update(update: ProblemUpdate = {}, controls: UpdateControls = {}): Promise<Solution> {
    const message = updateOf(this.sequence + 1, update, controls, this.shape);
    if (this.end !== undefined) throw this.end;
    return new Promise((resolve, reject) => {
      const waiting = { resolve, reject, until: performance.now() + (controls.deadlineMs ?? Infinity) };
      this.send({ message, waiting: this.timed(waiting, this.sequence + 1, controls.deadlineMs) });
    });
  }

  // Rejects an update whose deadline passes while the server is lost; otherwise the server reports the deadline, unless
  // it is silent.
  private timed(waiting: Waiting, sequence: number, deadlineMs: number | undefined): Waiting {
    const graceMs = this.controls.answerGraceMs ?? answerGraceMs;
    if (deadlineMs === undefined || deadlineMs + graceMs > longestTimerMs) return waiting;
    // One millisecond later, because a timer may fire a little early.
    const later = (ms: number, action: () => void): NodeJS.Timeout => setTimeout(action, Math.ceil(ms) + 1);
    const timers = [
      later(deadlineMs, () => this.lostCause && this.rejectLate(this.lostCause)),
      later(deadlineMs + graceMs, () => this.miss(sequence, deadlineMs + graceMs, graceMs)),
    ];
    const untimed =
      <Result>(settle: (result: Result) => void) =>
      (result: Result): void => {
        timers.forEach(clearTimeout);
        settle(result);
      };
    return { ...waiting, resolve: untimed(waiting.resolve), reject: untimed(waiting.reject) };
  }

  // Rejects updates whose deadline has passed without a server. Their data take effect with the next update.
  private rejectLate(cause: MarbleError): void {
    for (const [sequence, { message, waiting }] of this.sent) {
      if (waiting === undefined || performance.now() < waiting.until) continue;
      this.leaveToNext(sequence, message);
      waiting.reject(errorOf("unavailable", `the deadline passed while the server was lost: ${cause.message}`, { cause }));
    }
  }

  // Gives up an update whose result has not come in time. A server that answers none is lost.
  private miss(sequence: number, afterMs: number, graceMs: number): void {
    const sent = this.sent.get(sequence);
    if (sent?.waiting === undefined) return;
    this.leaveToNext(sequence, sent.message);
    this.lastMissed = true;
    // A server that solves an earlier update need not hang.
    const busy = [...this.sent].some(([number, { waiting }]) => number < sequence && waiting !== undefined);
    if (!busy) this.misses += 1;
    if (this.misses === mostMisses) {
      this.hung = lost(`the server left ${mostMisses} updates in a row without an answer`, undefined);
      this.stream?.cancel();
    }
    const text = `the server did not answer within ${afterMs} ms, ${graceMs} ms after the deadline`;
    sent.waiting.reject(errorOf("deadline_exceeded", text));
  }

  /**
   * Sends the first part of an update before all of its data are known. The next update is the second part; its
   * solution has the bits of one update with both parts. The server scales the data and factorizes for the branch on
   * which the solve will begin, and returns nothing. If it refuses the first part, the next update rejects.
   * @throws InvalidProblemError if a part does not fit.
   */
  prepare(update: ProblemUpdate = {}, controls: Omit<UpdateControls, "deadlineMs" | "sensitivity"> = {}): void {
    const message = { ...updateOf(this.sequence + 1, update, controls, this.shape), prepare: true };
    if (this.end !== undefined) throw this.end;
    this.send({ message });
  }

  /**
   * Ends the session after the updates sent so far, and waits until they have their results. It does not wait for a
   * server that has left the last update without an answer.
   */
  async close(): Promise<void> {
    if (this.end === undefined) {
      this.end = ended();
      if (this.lastMissed) this.aborter.abort();
      else this.stream?.end();
      this.wake();
    }
    await this.finished;
  }

  /** Calls `close` at the end of an `await using` block. */
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

  // Reads events and reopens after losses, until the session ends.
  private async run(): Promise<void> {
    const { signal } = this.controls;
    const abort = (): void => this.aborter.abort(signal?.reason);
    signal?.addEventListener("abort", abort, { once: true });
    this.aborter.signal.addEventListener("abort", () => (this.stream?.cancel(), this.wake()), { once: true });
    try {
      for (let cause = await this.listen(); cause !== undefined; cause = await this.listen()) await this.reopen(cause);
      this.end ??= ended();
    } catch (error) {
      this.end = errorOfCall(error);
    }
    signal?.removeEventListener("abort", abort);
    this.stream?.cancel();
    this.stream = undefined;
    for (const { waiting } of this.sent.values()) waiting?.reject(this.end);
    this.sent.clear();
  }

  // Reads events until the server ends the session. Returns the cause of a loss if the session must be reopened.
  private async listen(): Promise<MarbleError | undefined> {
    try {
      for await (const event of this.stream?.events() ?? []) this.take(event);
      return undefined;
    } catch (thrown) {
      if (this.aborter.signal.aborted) throw cancelled(this.aborter.signal);
      const error = this.hung ?? thrown;
      this.hung = undefined;
      if (this.memory === undefined || !isLost(error)) throw error;
      this.stream = undefined;
      this.lostCause = error;
      this.rejectLate(error);
      while (this.sent.size === 0 && this.end === undefined && !this.aborter.signal.aborted) {
        await new Promise<void>((wake) => (this.wake = wake));
      }
      if (this.aborter.signal.aborted) throw cancelled(this.aborter.signal);
      return this.anyWaits || this.end === undefined ? error : undefined;
    }
  }

  private async reopen(cause: MarbleError): Promise<void> {
    const totalMs = this.controls.reopenMs ?? reopenMs;
    const { signal } = this.aborter;
    const end = performance.now() + totalMs;
    const patience = new Patience({ totalMs, signal });
    let stream: SessionStream | undefined;
    while (stream === undefined) {
      const unanswered = [...this.sent.values()].map(({ message }) => message);
      const setup = expect(this.memory).setupFor(unanswered, this.epoch + 1);
      try {
        const leftMs = Math.max(shortestAttemptMs, end - performance.now());
        // A server that takes much longer than the last one counts as one that hangs.
        const withinMs = Math.min(leftMs, shortestAttemptMs + 10_000 * this.setupS);
        stream = await SessionStream.open(this.connection, setup, signal, withinMs);
      } catch (error) {
        // The server may not have released the lost session's resources yet.
        if (!isLost(error) && !(error instanceof RefusedError)) throw error;
        await patience.pause(error);
      }
    }
    this.epoch += 1;
    this.restartsSeen = this.misses = 0;
    this.lastMissed = false;
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
    this.misses = 0;
    this.lastMissed = false;
    // A draining server has not taken the update; the next server will.
    if (sent === undefined || (this.memory !== undefined && isLost(error))) return;
    if (sent.givenUp) {
      if (isInvalid(error)) this.settle(sequence, error);
      return;
    }
    if (sent.waiting === undefined) {
      // Older servers solve a first part as an update; this solution is ignored.
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

  // Treats an update without a result as a first part of the next one, which includes its data. A later result is
  // discarded.
  private leaveToNext(sequence: number, message: SessionUpdate): void {
    const part = { ...message, prepare: true, deadlineS: 0, sensitivity: undefined };
    if (this.memory === undefined) this.sent.delete(sequence);
    else this.sent.set(sequence, { message: part, givenUp: true });
  }

  // Removes an update with its first parts. The server ignored the data of an invalid one.
  private settle(sequence: number, error: MarbleError | undefined): void {
    const refused = isInvalid(error);
    for (const [number, { message, waiting }] of this.sent) {
      if (number > sequence) break;
      if (number < sequence && (refused || waiting !== undefined)) continue;
      this.sent.delete(number);
      if (!refused) this.memory?.take(message);
    }
  }

  private answered({ solution, restarts }: SessionAnswer): Solution {
    const message = expect(solution);
    const answer = new Solution(this.jobId, message);
    if (restarts > this.restartsSeen) this.memory?.startFrom(undefined);
    else if (answer.solved) this.memory?.startFrom(message.z);
    this.restartsSeen = restarts;
    return answer;
  }
}

function isInvalid(error: MarbleError | undefined): boolean {
  return error instanceof InvalidProblemError || error instanceof PreconditionError;
}

function ended(): MarbleError {
  return errorOf("failed_precondition", "the session has ended");
}
