import type { errorNames } from "./shared/tables.js";

/** Details of an error besides its message. */
export interface ErrorDetails {
  /** The invalid field, by the caller's names: "A.values", "options.maxIterations". */
  field?: string;
  /** The index of the invalid entry, from 0. */
  index?: number;
  /** The invalid value. */
  value?: string;
  /** The rule that the value violates. */
  bound?: string;
  /** After how many milliseconds another attempt may succeed. */
  retryAfterMs?: number;
  cause?: unknown;
}

/** The kind of an error: the name of its gRPC code, in lower case. */
export type ErrorCode = (typeof errorNames)[keyof typeof errorNames];

/** Base class of all errors of this package. A solve that ends unsolved returns a solution, not an error. */
export class MarbleError extends Error {
  readonly code: ErrorCode;
  declare readonly field?: string;
  declare readonly index?: number;
  declare readonly value?: string;
  declare readonly bound?: string;
  declare readonly retryAfterMs?: number;

  constructor(code: ErrorCode, message: string, details: ErrorDetails = {}) {
    super(message, details.cause === undefined ? undefined : { cause: details.cause });
    this.name = new.target.name;
    this.code = code;
    const { field, index, value, bound, retryAfterMs } = details;
    Object.assign(this, withoutGaps({ field, index, value, bound, retryAfterMs }));
  }
}

/** Invalid input: a part of a problem, an option, an address. `field`, `index`, `value` and `bound` name it. */
export class InvalidProblemError extends MarbleError {}

/** A queue, a quota or a limit of the server is full; `retryAfterMs` is set if waiting helps. */
export class RefusedError extends MarbleError {}

/** The server is unreachable or draining, or it is not a Marble server. */
export class UnavailableError extends MarbleError {}

/** The deadline passed before the result was there. */
export class DeadlineError extends MarbleError {}

/** The caller cancelled the call; `cause` is the signal's reason. */
export class CancelledError extends MarbleError {}

/** A newer update of the session replaced this one and included its data. */
export class SupersededError extends CancelledError {
  /** The number of the newer update. */
  readonly bySequence: number;
  constructor(bySequence: number) {
    super("cancelled", `update ${bySequence} took its place`);
    this.bySequence = bySequence;
  }
}

/** The server does not know the client, or does not permit the call. */
export class AccessError extends MarbleError {}

/** The job does not exist, is no longer kept, or belongs to another client. */
export class NotFoundError extends MarbleError {}

/** The call does not fit the current state: the job has not finished, the session or the client is closed. */
export class PreconditionError extends MarbleError {}

/** The server ended a session that was idle for too long. */
export class AbortedError extends MarbleError {}

/** A bug of the server; the message contains the job id to look for in its log. */
export class InternalError extends MarbleError {}

const classes: Record<ErrorCode, typeof MarbleError> = {
  invalid_argument: InvalidProblemError,
  failed_precondition: PreconditionError,
  resource_exhausted: RefusedError,
  not_found: NotFoundError,
  unavailable: UnavailableError,
  cancelled: CancelledError,
  deadline_exceeded: DeadlineError,
  permission_denied: AccessError,
  unauthenticated: AccessError,
  aborted: AbortedError,
  internal: InternalError,
};

/** An error of the class for `code`. */
export function errorOf(code: ErrorCode, message: string, details: ErrorDetails = {}): MarbleError {
  return new classes[code](code, message, details);
}

/** An InvalidProblemError with a message such as "A.values[3] = NaN: must be finite". */
export function invalid(field: string, bound: string, at: { index?: number; value?: unknown } = {}): MarbleError {
  const place = at.index === undefined ? field : `${field}[${at.index}]`;
  const value = at.value === undefined ? undefined : String(at.value);
  const message = value === undefined ? `${place}: ${bound}` : `${place} = ${value}: ${bound}`;
  return errorOf("invalid_argument", message, { field, index: at.index, value, bound });
}

/** Runs `check` and puts `path` before the field of an InvalidProblemError that it throws. */
export function within<Result>(path: string, check: () => Result): Result {
  try {
    return check();
  } catch (error) {
    if (!(error instanceof InvalidProblemError) || error.field === undefined) throw error;
    throw invalid(`${path}.${error.field}`, error.bound ?? error.message, error);
  }
}

function withoutGaps(details: object): object {
  return Object.fromEntries(Object.entries(details).filter(([, value]) => value !== undefined));
}
