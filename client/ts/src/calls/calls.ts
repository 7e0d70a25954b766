// Calls as promises and async iterables: with a deadline, an abort signal, and this package's errors.
import type { CallOptions, ClientDuplexStream, ClientReadableStream, MethodDefinition } from "@grpc/grpc-js";

import { checkDeadline, untilForever } from "../base/checks.js";
import { invalid } from "../base/errors.js";
import type { Connection } from "../connection/connection.js";
import { cancelled, errorOfCall } from "./status.js";

/** What may accompany any call. */
export interface CallControls {
  /** Gives the call up: the promise is rejected with a CancelledError, and the server stops within one iteration. */
  signal?: AbortSignal;
  /** Hard limit from now on, in milliseconds > 0: no answer comes back after it. Default: that of `connect`. */
  deadlineMs?: number;
}

interface Cancellable {
  cancel(): void;
}

/** One message there, one back. */
export async function unary<Request, Response>(
  connection: Connection,
  method: MethodDefinition<Request, Response>,
  request: Request,
  controls: CallControls = {},
): Promise<Response> {
  const { signal } = controls;
  const options = callOptions(controls, connection.deadlineMs);
  checkSignal(signal);
  const channel = connection.open();
  return new Promise((resolve, reject) => {
    const call = channel.makeUnaryRequest(
      method.path,
      method.requestSerialize,
      method.responseDeserialize,
      request,
      connection.metadata(),
      options,
      (error, response) => {
        release();
        if (error) reject(errorOfCall(error, signal));
        else resolve(response as Response);
      },
    );
    const release = cancelOnAbort(call, signal);
  });
}

/** One message there, many back. The call begins with the iteration and ends with it. */
export async function* serverStream<Request, Response>(
  connection: Connection,
  method: MethodDefinition<Request, Response>,
  request: Request,
  controls: CallControls,
  defaultDeadlineMs?: number,
): AsyncGenerator<Response, void, undefined> {
  const { signal } = controls;
  const options = callOptions(controls, defaultDeadlineMs);
  checkSignal(signal);
  const call = connection.open().makeServerStreamRequest(
    method.path,
    method.requestSerialize,
    method.responseDeserialize,
    request,
    connection.metadata(),
    options,
  );
  const release = cancelOnAbort(call, signal);
  try {
    yield* received(call, signal);
  } finally {
    release();
    call.cancel();
  }
}

/** A stream both ways, for whoever reads and writes it himself; it ends with the signal. */
export function duplex<Request, Response>(
  connection: Connection,
  method: MethodDefinition<Request, Response>,
  signal?: AbortSignal,
): ClientDuplexStream<Request, Response> {
  checkSignal(signal);
  const call = connection.open().makeBidiStreamRequest(
    method.path,
    method.requestSerialize,
    method.responseDeserialize,
    connection.metadata(),
  );
  call.once("status", cancelOnAbort(call, signal));
  return call;
}

/** The messages of a stream, as fast as they are taken; the next is read when it is wanted. */
export async function* received<Response>(
  call: ClientReadableStream<Response>,
  signal?: AbortSignal,
): AsyncGenerator<Response, void, undefined> {
  call.on("error", () => undefined); // told below; after an early end nobody waits for it
  try {
    for await (const message of call) yield message as Response;
  } catch (error) {
    throw errorOfCall(error, signal);
  }
}

function callOptions(controls: CallControls, defaultDeadlineMs: number | undefined): CallOptions {
  checkDeadline("deadlineMs", controls.deadlineMs);
  const limit = untilForever(controls.deadlineMs ?? defaultDeadlineMs);
  return limit === undefined ? {} : { deadline: Date.now() + limit };
}

function checkSignal(signal: AbortSignal | undefined): void {
  if (signal === undefined) return;
  if (!(signal instanceof AbortSignal)) throw invalid("signal", "must be an AbortSignal", { value: signal });
  if (signal.aborted) throw cancelled(signal);
}

function cancelOnAbort(call: Cancellable, signal: AbortSignal | undefined): () => void {
  if (signal === undefined) return () => undefined;
  const cancel = (): void => call.cancel();
  signal.addEventListener("abort", cancel, { once: true });
  return () => signal.removeEventListener("abort", cancel);
}
