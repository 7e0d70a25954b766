// gRPC's statuses and their details become errors here, and nowhere else.
import { Metadata, type ServiceError, status as Code } from "@grpc/grpc-js";

import { type ErrorCode, type ErrorDetails, MarbleError, errorOf, invalid } from "./errors.js";
import type { Duration } from "./generated/google/protobuf/duration.js";
import { BadRequest, RetryInfo } from "./generated/google/rpc/error_details.js";
import { Status } from "./generated/google/rpc/status.js";

const codes: Partial<Record<number, ErrorCode>> = {
  [Code.INVALID_ARGUMENT]: "invalid_argument",
  [Code.FAILED_PRECONDITION]: "failed_precondition",
  [Code.RESOURCE_EXHAUSTED]: "resource_exhausted",
  [Code.NOT_FOUND]: "not_found",
  [Code.UNAVAILABLE]: "unavailable",
  [Code.UNIMPLEMENTED]: "unavailable", // somebody answers there, but no Marble server
  [Code.CANCELLED]: "cancelled",
  [Code.DEADLINE_EXCEEDED]: "deadline_exceeded",
  [Code.PERMISSION_DENIED]: "permission_denied",
  [Code.UNAUTHENTICATED]: "unauthenticated",
  [Code.ABORTED]: "aborted",
};

/** The contract's names of a problem's parts, and the caller's. */
const parts: Record<string, string> = {
  hessian: "Q",
  gradient: "g",
  constant: "c0",
  equality_matrix: "A",
  equality_offset: "b",
  inequality_matrix: "C",
  inequality_offset: "d",
  left_matrix: "L",
  left_offset: "l",
  right_matrix: "R",
  right_offset: "r",
  hessian_values: "Q.values",
  equality_values: "A.values",
  inequality_values: "C.values",
  left_values: "L.values",
  right_values: "R.values",
};

/** Of a failed call. What is already an error of this package stays as it is. */
export function errorOfCall(thrown: unknown, signal?: AbortSignal): MarbleError {
  if (thrown instanceof MarbleError) return thrown;
  if (signal?.aborted) return cancelled(signal);
  if (!isServiceError(thrown)) {
    return errorOf("internal", thrown instanceof Error ? thrown.message : String(thrown), { cause: thrown });
  }
  return errorOfStatus({ ...detailsIn(thrown.metadata), code: thrown.code, message: thrown.details });
}

/** Of a status that came as a message. */
export function errorOfStatus(status: Status): MarbleError {
  const code = codes[status.code] ?? "internal";
  const details: ErrorDetails = {};
  for (const any of status.details) {
    if (any.typeUrl.endsWith("/google.rpc.BadRequest")) {
      const violation = BadRequest.decode(any.value).fieldViolations[0];
      if (violation !== undefined) return violated(violation.field, violation.description);
    } else if (any.typeUrl.endsWith("/google.rpc.RetryInfo")) {
      details.retryAfterMs = milliseconds(RetryInfo.decode(any.value).retryDelay);
    }
  }
  return errorOf(code, status.message, details);
}

export function cancelled(signal: AbortSignal): MarbleError {
  return errorOf("cancelled", "cancelled by the caller", { cause: signal.reason as unknown });
}

// An intermediary's status has no details of ours, or none that can be read.
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

// "solve.problem.equality_matrix.values[3]", "is NaN, must be finite" → A.values[3] = NaN: must be finite
function violated(path: string, description: string): MarbleError {
  const [, name, index] = /^(?:solve\.|setup\.|update\.)*(?:problem\.)?(.*?)(?:\[(\d+)\])?$/.exec(path) ?? [];
  const [, value, bound] = /^is (.*?), (.*)$/s.exec(description) ?? [];
  return invalid(callersName(name), bound ?? description, {
    value,
    index: index === undefined ? undefined : Number(index),
  });
}

function callersName(name: string): string {
  if (name === "initial_point.z") return "initialPoint";
  const [head, ...rest] = name.split(".");
  return [parts[head] ?? head, ...rest].join(".").replace(/_(\w)/g, (_, letter: string) => letter.toUpperCase());
}

function milliseconds(duration: Duration | undefined): number {
  return duration === undefined ? 0 : 1000 * duration.seconds + duration.nanos / 1e6;
}
