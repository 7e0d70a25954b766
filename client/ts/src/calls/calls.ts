// Calls as promises and async iterables: with a deadline, an abort signal, and this package's errors.
import type {
  CallOptions,
  ClientDuplexStream,
  ClientReadableStream,
  ClientUnaryCall,
  ClientWritableStream,
  MethodDefinition,
} from "@grpc/grpc-js";

import { checkDeadline, untilForever } from "../checks.js";
import { invalid } from "../errors.js";
import type { Place } from "../connection/channels.js";
import type { Connection } from "../connection/connection.js";
import { JobsService, ServerService, SolverService } from "../generated/marble/v1/service.js";
import { Patience, repeated } from "./patience.js";
import { cancelled, errorOfCall, isLost } from "./status.js";

/** Parameters of any call. */
export interface CallControls {
  /** Cancels the call: the promise rejects with a CancelledError, and the server stops within one iteration. */
  signal?: AbortSignal;
  /** Hard limit from now, in milliseconds > 0; no result arrives after it. Default: that of `connect`. */
  deadlineMs?: number;
}

// Calls that are safe to repeat: solves leave nothing behind, a stream repeats until its first event, and a submission
// is one job by its request id. Sessions and batches repeat their own messages.
const repeatable = new Set<string>(
  [
    ...[SolverService.solve, SolverService.solveStream, SolverService.solveScenarios, SolverService.solveCoupled],
    ...[JobsService.submit, JobsService.result, JobsService.list, JobsService.get, JobsService.watch],
    ServerService.getInfo,
  ].map(({ path }) => path),
);

type Call =
  ClientUnaryCall | ClientReadableStream<unknown> | ClientWritableStream<unknown> | ClientDuplexStream<unknown, unknown>;

/** A unary call. */
export async function unary<Request, Response>(
  connection: Connection,
  method: MethodDefinition<Request, Response>,
  request: Request,
  controls: CallControls = {},
): Promise<Response> {
  const { signal } = controls;
  const limits = { deadline: deadlineOf(controls, connection.deadlineMs), signal };
  const attempt = (): Promise<Response> => unaryOnce(connection, method, request, limits);
  return repeatable.has(method.path) ? repeated(connection, limits, attempt) : attempt();
}

async function unaryOnce<Request, Response>(
  connection: Connection,
  method: MethodDefinition<Request, Response>,
  request: Request,
  { deadline, signal }: { deadline?: number; signal?: AbortSignal },
): Promise<Response> {
  checkSignal(signal);
  const place = connection.take();
  return new Promise((resolve, reject) => {
    const call = place.channel.makeUnaryRequest(
      method.path,
      method.requestSerialize,
      method.responseDeserialize,
      request,
      connection.metadata(),
      callOptions(deadline),
      (error, response) => {
        if (error) reject(errorOfCall(error, signal));
        else resolve(response as Response);
      },
    );
    follow(call, place, signal);
  });
}

/** A client-streaming call; each message is written when the previous one was sent. */
export async function clientStream<Request, Response>(
  connection: Connection,
  method: MethodDefinition<Request, Response>,
  requests: Iterable<Request>,
  { deadline, signal }: { deadline?: number; signal?: AbortSignal },
): Promise<Response> {
  checkSignal(signal);
  const place = connection.take();
  return new Promise((resolve, reject) => {
    const call = place.channel.makeClientStreamRequest(
      method.path,
      method.requestSerialize,
      method.responseDeserialize,
      connection.metadata(),
      callOptions(deadline),
      (error, response) => {
        if (error) reject(errorOfCall(error, signal));
        else resolve(response as Response);
      },
    );
    call.on("error", () => undefined); // reported by the callback
    follow(call, place, signal);
    const source = requests[Symbol.iterator]();
    const next = (): void => {
      const { done, value } = source.next();
      if (done) call.end();
      else call.write(value, next);
    };
    next();
  });
}

/** A server-streaming call. It begins with the iteration and ends with it. */
export async function* serverStream<Request, Response>(
  connection: Connection,
  method: MethodDefinition<Request, Response>,
  request: Request,
  controls: CallControls,
  defaultDeadlineMs?: number,
): AsyncGenerator<Response, void, undefined> {
  const { signal } = controls;
  const deadline = deadlineOf(controls, defaultDeadlineMs);
  let patience: Patience | undefined;
  let begun = false;
  for (;;) {
    checkSignal(signal);
    const place = connection.take();
    const call = place.channel.makeServerStreamRequest(
      method.path,
      method.requestSerialize,
      method.responseDeserialize,
      request,
      connection.metadata(),
      callOptions(deadline),
    );
    follow(call, place, signal);
    try {
      for await (const message of received(call, signal)) {
        begun = true;
        yield message;
      }
      return;
    } catch (error) {
      if (begun || !isLost(error) || !repeatable.has(method.path)) throw error;
      patience ??= new Patience({ totalMs: connection.waitMs, deadline, signal });
      await patience.pause(error);
    } finally {
      call.cancel();
    }
  }
}

/** A bidirectional call, which the caller reads and writes; it ends with the signal. */
export function duplex<Request, Response>(
  connection: Connection,
  method: MethodDefinition<Request, Response>,
  signal?: AbortSignal,
): ClientDuplexStream<Request, Response> {
  checkSignal(signal);
  const place = connection.take();
  const call = place.channel.makeBidiStreamRequest(
    method.path,
    method.requestSerialize,
    method.responseDeserialize,
    connection.metadata(),
  );
  follow(call, place, signal);
  return call;
}

/** The messages of a stream; the next is read when the caller requests it. */
export async function* received<Response>(
  call: ClientReadableStream<Response>,
  signal?: AbortSignal,
): AsyncGenerator<Response, void, undefined> {
  call.on("error", () => undefined); // thrown below; ignored if the caller has left the loop
  try {
    for await (const message of call) yield message as Response;
  } catch (error) {
    throw errorOfCall(error, signal);
  }
}

/** When a call must end, in the time of Date.now(); undefined without a deadline. */
export function deadlineOf(controls: CallControls, defaultDeadlineMs: number | undefined): number | undefined {
  checkDeadline("deadlineMs", controls.deadlineMs);
  const limit = untilForever(controls.deadlineMs ?? defaultDeadlineMs);
  return limit === undefined ? undefined : Date.now() + limit;
}

function callOptions(deadline: number | undefined): CallOptions {
  return deadline === undefined ? {} : { deadline };
}

function checkSignal(signal: AbortSignal | undefined): void {
  if (signal === undefined) return;
  if (!(signal instanceof AbortSignal)) throw invalid("signal", "must be an AbortSignal", { value: signal });
  if (signal.aborted) throw cancelled(signal);
}

// Ties the signal and the reserved connection to the life of a call.
function follow(call: Call, { release }: Place, signal: AbortSignal | undefined): void {
  const cancel = (): void => call.cancel();
  signal?.addEventListener("abort", cancel, { once: true });
  call.once("status", () => {
    signal?.removeEventListener("abort", cancel);
    release();
  });
}
