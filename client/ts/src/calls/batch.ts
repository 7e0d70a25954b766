import type { ClientDuplexStream } from "@grpc/grpc-js";

import { MarbleError, RefusedError, errorOf } from "../errors.js";
import type { Connection } from "../connection/connection.js";
import {
  type SolveBatchRequest,
  type SolveBatchResponse,
  type SolveRequest,
  SolverService,
} from "../generated/marble/v1/service.js";
import type { Problem } from "../model/problem.js";
import { Solution } from "../model/solution.js";
import { duplex, received } from "./calls.js";
import { Patience } from "./patience.js";
import { type Priority, type RequestControls, expect, solveRequest } from "./solve.js";
import { cancelled, errorOfStatus, isLost } from "./status.js";

/** One problem of a batch. */
export interface BatchProblem<Tag> extends Omit<RequestControls, "priority"> {
  /** Returned with the result. */
  tag: Tag;
  problem: Problem;
}

/** The result of one problem: its solution or its error. */
export type BatchAnswer<Tag> =
  { tag: Tag; solution: Solution; error?: undefined } | { tag: Tag; solution?: undefined; error: MarbleError };

/** Parameters of a whole batch. */
export interface BatchControls {
  priority?: Priority;
  /** Cancels the whole batch. */
  signal?: AbortSignal;
}

type Call = ClientDuplexStream<SolveBatchRequest, SolveBatchResponse>;
type Source<Tag> = AsyncIterable<BatchProblem<Tag>> | Iterable<BatchProblem<Tag>>;

/**
 * Yields results in the order of finishing. Requests the next problem from the source when the server has taken the
 * last one. If the server is lost or drains, the unsolved problems are sent to the next server; problems that a full
 * server refused are sent again after the time that it requests.
 */
export async function* batch<Tag>(
  connection: Connection,
  source: Source<Tag>,
  controls: BatchControls,
): AsyncGenerator<BatchAnswer<Tag>, void, undefined> {
  const { priority, signal } = controls;
  const sender = new Sender(source, priority);
  let patience: Patience | undefined;
  try {
    for (;;) {
      const call: Call = duplex(connection, SolverService.solveBatch, signal);
      try {
        const sent = sender.feed(call);
        for await (const { tag, outcome } of received(call, signal)) {
          const answer = sender.answer(tag, outcome);
          if (answer === undefined) continue;
          patience = undefined;
          yield* sender.faulty.splice(0);
          yield answer;
        }
        await sent;
        if (!sender.isDone) throw sender.refused ?? errorOf("internal", "the server ended the batch without all results");
        return yield* sender.faulty.splice(0);
      } catch (error) {
        if (sender.failure !== undefined) throw sender.failure.thrown;
        if (!isLost(error)) throw error;
        if (!(await sender.hasMore(signal))) return yield* sender.faulty.splice(0);
        patience ??= new Patience({ totalMs: connection.waitMs, signal });
        await patience.pause(error);
      } finally {
        call.cancel();
      }
    }
  } finally {
    sender.stop();
  }
}

/** A problem that a draining server refused goes to the next stream; if this one continues, it is sent again on it. */
const drainingMs = 1000;

interface Numbered<Tag> {
  tag: Tag;
  solve: SolveRequest;
}

class Sender<Tag> {
  /** Results of invalid problems, which are not sent. */
  readonly faulty: BatchAnswer<Tag>[] = [];
  /** What the source threw. */
  failure?: { thrown: unknown };
  /** Why a draining server refused the last problem. */
  refused?: MarbleError;
  private readonly items: AsyncGenerator<BatchProblem<Tag>, void, undefined>;
  private next?: Promise<IteratorResult<BatchProblem<Tag>, void>>;
  private over = false;
  private readonly unanswered = new Map<number, Numbered<Tag>>();
  private call?: Call;
  private count = 0;
  /** Refused problems that are due on the present call, and the timers of the others. */
  private again: number[] = [];
  private readonly timers = new Set<NodeJS.Timeout>();

  constructor(
    source: Source<Tag>,
    private readonly priority: Priority | undefined,
  ) {
    this.items = each(source);
  }

  /** The source is exhausted and every problem has its result. */
  get isDone(): boolean {
    return this.over && this.unanswered.size === 0;
  }

  /** Sends the unsolved problems, then those of the source, until the call ends. */
  async feed(call: Call): Promise<void> {
    this.call = call;
    this.refused = undefined;
    call.once("status", () => this.leave(call));
    try {
      await this.send(call);
    } catch (thrown) {
      this.failure ??= { thrown };
      call.cancel();
    }
  }

  private async send(call: Call): Promise<void> {
    for (const [number, { solve }] of [...this.unanswered]) {
      if (this.call !== call) return;
      await this.write(call, number, solve);
    }
    while (this.call === call) {
      const due = this.again.shift();
      if (due !== undefined) {
        await this.write(call, due, expect(this.unanswered.get(due)).solve);
        continue;
      }
      if (this.isDone) {
        call.end();
        return;
      }
      const change = this.change();
      const item = await (this.over ? change : Promise.race([this.peek(), change]));
      if (this.call !== call) return; // the next call sends it
      if (item === undefined) continue;
      this.next = undefined;
      if (item.done) {
        this.over = true;
        continue;
      }
      const solve = this.request(item.value);
      if (solve === undefined) continue;
      this.unanswered.set(++this.count, { tag: item.value.tag, solve });
      await this.write(call, this.count, solve);
    }
  }

  /** Whether there is anything to send. If every problem has its result, waits for the source's next one. */
  async hasMore(signal: AbortSignal | undefined): Promise<boolean> {
    if (this.unanswered.size > 0) return true;
    if (this.over) return false;
    const item = await unlessAborted(this.peek(), signal);
    if (item.done) this.over = true;
    return !item.done;
  }

  /** The result of a problem; undefined if it is sent again. */
  answer(number: number, outcome: SolveBatchResponse["outcome"]): BatchAnswer<Tag> | undefined {
    const { tag } = expect(this.unanswered.get(number));
    const { $case, value } = expect(outcome);
    const error = $case === "error" ? errorOfStatus(value) : undefined;
    if (isLost(error)) this.refused = error;
    const pauseMs = pauseAfter(error);
    if (pauseMs !== undefined) {
      this.sendAgain(number, pauseMs);
      return undefined;
    }
    this.unanswered.delete(number);
    if (this.isDone) this.changed();
    if ($case === "error") return { tag, error: errorOfStatus(value) };
    return { tag, solution: new Solution(value.jobId, expect(value.solution)) };
  }

  private sendAgain(number: number, pauseMs: number): void {
    const timer = setTimeout(() => {
      this.timers.delete(timer);
      this.again.push(number);
      this.changed();
    }, pauseMs);
    this.timers.add(timer);
  }

  /** Stops reading the source. */
  stop(): void {
    if (this.call !== undefined) this.leave(this.call);
    if (!this.over) this.items.return().catch(() => undefined);
  }

  // The next problem stays until a call takes it. The batch rethrows errors of the source.
  private peek(): Promise<IteratorResult<BatchProblem<Tag>, void>> {
    if (this.next === undefined) {
      this.next = this.items.next();
      this.next.catch((thrown: unknown) => (this.failure = { thrown }));
    }
    return this.next;
  }

  private request({ tag, problem, ...controls }: BatchProblem<Tag>): SolveRequest | undefined {
    try {
      return solveRequest(problem, { ...controls, priority: this.priority });
    } catch (error) {
      if (!(error instanceof MarbleError)) throw error;
      this.faulty.push({ tag, error });
      return undefined;
    }
  }

  private leave(call: Call): void {
    if (this.call === call) {
      this.call = undefined;
      this.timers.forEach(clearTimeout);
      this.timers.clear();
      this.again = [];
    }
    this.changed();
    this.wake();
  }

  // Resolves when a refused problem is due, every problem has its result, or the call has ended.
  private change(): Promise<undefined> {
    return new Promise((resolve) => (this.changed = () => resolve(undefined)));
  }

  private changed: () => void = () => undefined;

  // Resolves when the message was written: flow control delays it while the server does not read.
  private write(call: Call, tag: number, solve: SolveRequest): Promise<void> {
    return new Promise((resolve) => {
      this.wake = resolve;
      call.write({ tag, solve }, () => resolve());
    });
  }

  private wake: () => void = () => undefined;
}

/** After how long a problem with this error is sent again; undefined if that does not help. */
function pauseAfter(error: MarbleError | undefined): number | undefined {
  if (error instanceof RefusedError) return error.retryAfterMs;
  return isLost(error) ? drainingMs : undefined;
}

async function* each<Item>(source: AsyncIterable<Item> | Iterable<Item>): AsyncGenerator<Item, void, undefined> {
  yield* source;
}

async function unlessAborted<Result>(promise: Promise<Result>, signal: AbortSignal | undefined): Promise<Result> {
  if (signal === undefined) return promise;
  let giveUp = (): void => undefined;
  const aborted = new Promise<never>((_, reject) => {
    giveUp = () => reject(cancelled(signal));
    signal.addEventListener("abort", giveUp, { once: true });
    if (signal.aborted) giveUp();
  });
  return Promise.race([promise, aborted]).finally(() => signal.removeEventListener("abort", giveUp));
}
