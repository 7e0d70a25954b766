import type { ClientDuplexStream } from "@grpc/grpc-js";

import { MarbleError } from "../base/errors.js";
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
import { type Priority, type RequestControls, expect, solveRequest } from "./solve.js";
import { errorOfStatus } from "./status.js";

/** One problem of many. */
export interface BatchProblem<Tag> extends Omit<RequestControls, "priority"> {
  /** Comes back with the answer. */
  tag: Tag;
  problem: Problem;
}

/** What came of one problem: its solution, or why there is none. */
export type BatchAnswer<Tag> =
  { tag: Tag; solution: Solution; error?: undefined } | { tag: Tag; solution?: undefined; error: MarbleError };

/** What holds for a batch as a whole. */
export interface BatchControls {
  priority?: Priority;
  /** Gives all of it up. */
  signal?: AbortSignal;
}

type Call = ClientDuplexStream<SolveBatchRequest, SolveBatchResponse>;
type Source<Tag> = AsyncIterable<BatchProblem<Tag>> | Iterable<BatchProblem<Tag>>;

/** Answers in the order of finishing. The source is asked for the next problem when the server has taken the last one. */
export async function* batch<Tag>(
  connection: Connection,
  source: Source<Tag>,
  controls: BatchControls,
): AsyncGenerator<BatchAnswer<Tag>, void, undefined> {
  const call: Call = duplex(connection, SolverService.solveBatch, controls.signal);
  const answers = received(call, controls.signal);
  const sender = new Sender(call, source, controls.priority);
  const sent = sender.run();
  try {
    for await (const { tag, outcome } of answers) {
      yield* sender.faulty.splice(0);
      yield sender.answer(tag, outcome);
    }
    await sent;
    yield* sender.faulty.splice(0);
  } catch (error) {
    throw sender.failure ?? error;
  } finally {
    call.cancel();
    sender.stop();
  }
}

class Sender<Tag> {
  /** Problems that break a rule, told before they were sent. */
  readonly faulty: BatchAnswer<Tag>[] = [];
  /** What the source threw. */
  failure: unknown;
  private readonly tags = new Map<number, Tag>();
  private stopped = false;
  private count = 0;

  constructor(
    private readonly call: Call,
    private readonly source: Source<Tag>,
    private readonly priority: Priority | undefined,
  ) {}

  async run(): Promise<void> {
    this.call.once("status", () => this.stop());
    try {
      for await (const item of this.source) {
        if (this.stopped) return;
        const solve = this.request(item);
        if (solve === undefined) continue;
        this.tags.set(++this.count, item.tag);
        await this.write({ tag: this.count, solve });
      }
      this.call.end();
    } catch (error) {
      if (this.stopped) return;
      this.failure = error;
      this.call.cancel();
    }
  }

  stop(): void {
    this.stopped = true;
    this.wake();
  }

  answer(number: number, outcome: SolveBatchResponse["outcome"]): BatchAnswer<Tag> {
    const tag = this.tags.get(number) as Tag;
    this.tags.delete(number);
    const { $case, value } = expect(outcome);
    if ($case === "error") return { tag, error: errorOfStatus(value) };
    return { tag, solution: new Solution(value.jobId, expect(value.solution)) };
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

  // Done when the message is on its way: flow control holds it back while the server does not read.
  private write(request: SolveBatchRequest): Promise<void> {
    return new Promise((resolve) => {
      this.wake = resolve;
      this.call.write(request, () => resolve());
    });
  }

  private wake: () => void = () => undefined;
}
