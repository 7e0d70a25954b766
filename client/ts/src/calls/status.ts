// Conversion of gRPC statuses and their details to errors.
import { Metadata, type ServiceError, status as statuses } from "@grpc/grpc-js";

import { type ErrorCode, MarbleError, errorOf, invalid } from "../errors.js";
import { defaultAddress, errorNames, matrices, matrixValues, noServerHint, vectors } from "../shared/tables.js";
import type { Duration } from "../generated/google/protobuf/duration.js";
import { BadRequest, RetryInfo } from "../generated/google/rpc/error_details.js";
import { Status } from "../generated/google/rpc/status.js";
import { Fault } from "../generated/marble/v1/fault.js";

/** The caller's names of a problem's parts and of an update's values, by those of the contract. */
const parts: Record<string, string> = {
  constant: "c0",
  ...inverse(vectors),
  ...inverse(matrices),
  ...inverse(matrixValues, ".values"),
};

function inverse(names: Record<string, string>, suffix = ""): Record<string, string> {
  return Object.fromEntries(Object.entries(names).map(([letter, field]) => [field, letter + suffix]));
}

/**
 * Whether the server is lost or draining, so that another one, or the same one after a restart, would take the call.
 */
export function isLost(error: unknown): error is MarbleError {
  return error instanceof MarbleError && losses.has(error);
}

/** The loss of a server that gRPC did not report. */
export function lost(message: string, cause: unknown): MarbleError {
  const error = errorOf("unavailable", message, { cause });
  losses.add(error);
  return error;
}

// A separate set, because "unavailable" also means that the server is not a Marble server.
const losses = new WeakSet<MarbleError>();

/** The error of a failed call; errors of this package are returned unchanged. */
export function errorOfCall(thrown: unknown, signal?: AbortSignal): MarbleError {
  if (thrown instanceof MarbleError) return thrown;
  if (signal?.aborted) return cancelled(signal);
  if (!isServiceError(thrown)) {
    return errorOf("internal", thrown instanceof Error ? thrown.message : String(thrown), { cause: thrown });
  }
  return errorOfStatus({ ...detailsIn(thrown.metadata), code: thrown.code, message: thrown.details });
}

/** The error of a status in a message. */
export function errorOfStatus(status: Status): MarbleError {
  const code = (errorNames as Partial<Record<number, ErrorCode>>)[status.code] ?? "internal";
  const read = <Detail>(name: string, type: { decode(bytes: Uint8Array): Detail }): Detail | undefined => {
    const packed = status.details.find(({ typeUrl }) => typeUrl.endsWith(`/${name}`));
    return packed && type.decode(packed.value);
  };
  const fault = read("marble.v1.Fault", Fault);
  const place = fault && {
    field: callersName(fault.field),
    index: fault.index,
    value: fault.value === "" ? undefined : fault.value,
    bound: fault.bound,
  };
  if (code === "invalid_argument") {
    if (place !== undefined) return invalid(place.field, place.bound, place);
    const violation = read("google.rpc.BadRequest", BadRequest)?.fieldViolations[0];
    if (violation !== undefined) return violated(violation.field, violation.description);
  }
  const retry = read("google.rpc.RetryInfo", RetryInfo);
  const retryAfterMs = retry && milliseconds(retry.retryDelay);
  const hint = code === "unavailable" ? hintOf(status.message) : "";
  const message = status.message.replace(/\.? Resolution note: $/, ""); // grpc-js ends with it if the note is empty
  const error = errorOf(code, message + hint, { ...place, retryAfterMs });
  if (status.code === statuses.UNAVAILABLE) losses.add(error);
  return error;
}

// Messages of grpc-js about failed connections, with the likely reason.
const hints: [RegExp, string][] = [
  [
    /Failed to connect|ECONNRESET|EPIPE/,
    "; does the server want TLS (tls, MARBLE_TLS_CA), or a certificate of the client (MARBLE_TLS_CERTIFICATE)?",
  ],
  [/wrong version number/, "; does the server speak without TLS? This client uses it (tls, MARBLE_TLS_CA)"],
  [
    /self.signed certificate|unable to (?:verify|get)|certificate has expired/,
    "; tls.ca or MARBLE_TLS_CA must name the authority that signed the server's certificate",
  ],
];

function hintOf(message: string): string {
  if (message.includes(defaultAddress) && message.includes("ECONNREFUSED")) return noServerHint;
  if (!message.includes("No connection established")) return "";
  return hints.find(([pattern]) => pattern.test(message))?.[1] ?? "";
}

export function cancelled(signal: AbortSignal): MarbleError {
  return errorOf("cancelled", "cancelled by the caller", { cause: signal.reason as unknown });
}

// A status of a proxy has no details, or unreadable ones.
function detailsIn(metadata: Metadata | undefined): Status {
  const bytes = metadata?.get("grpc-status-details-bin")[0];
  try {
    if (bytes instanceof Uint8Array) return Status.decode(bytes);
  } catch {
    return { code: 0, message: "", details: [] };
  }
  return { code: 0, message: "", details: [] };
}

function isServiceError(thrown: unknown): thrown is ServiceError {
  return thrown instanceof Error && typeof (thrown as Partial<ServiceError>).code === "number";
}

// Servers without the message Fault send "solve.problem.equality_matrix.values[3]" and prose.
function violated(path: string, description: string): MarbleError {
  const [, name, index] = /^(.*?)(?:\[(\d+)\])?$/.exec(path) ?? [];
  return invalid(callersName(name), description, { index: index === undefined ? undefined : Number(index) });
}

function callersName(path: string): string {
  const name = path.replace(/^(?:solve\.|setup\.|update\.)*(?:problem\.)?/, "");
  const [, block, part] = /^(coupled\.blocks\[\d+\]\.problem\.)(.+)$/.exec(name) ?? [];
  if (block !== undefined) return block + callersName(part);
  if (name === "initial_point.z") return "initialPoint";
  const [head, ...rest] = name.replace(/_(\w)/g, (_, letter: string) => letter.toUpperCase()).split(".");
  return [parts[head] ?? head, ...rest].join(".");
}

function milliseconds(duration: Duration | undefined): number {
  return duration === undefined ? 0 : 1000 * duration.seconds + duration.nanos / 1e6;
}
