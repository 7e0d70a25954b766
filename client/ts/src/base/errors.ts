import type { errorNames } from "../shared/tables.js";

/** What an error tells beyond its message. */
export interface ErrorDetails {
  /** The part that is at fault, in the caller's terms: "A.values", "options.maxIterations". */
  field?: string;
  /** Its entry, from 0. */
  index?: number;
  /** What stands there. */
  value?: string;
  /** The rule that it breaks. */
  bound?: string;
  /** After how many milliseconds another attempt may succeed. */
  retryAfterMs?: number;
  cause?: unknown;
}

/** What kind of error it is: gRPC's words, in lower case. */
export type ErrorCode = (typeof errorNames)[keyof typeof errorNames];

/** Every error of this package. A solve that ends without being solved is not among them: it is an answer. */
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

/** What was given breaks a rule: a problem's part, an option, an address. `field`, `index`, `value`, `bound` say which. */
export class InvalidProblemError extends MarbleError {}

/** A queue, a quota or a limit of the server is full; `retryAfterMs` where waiting helps. */
export class RefusedError extends MarbleError {}

/** The server is not reachable, is draining, or is no Marble server. */
export class UnavailableError extends MarbleError {}

/** The deadline passed before there was an answer. */
export class DeadlineError extends MarbleError {}

/** The caller gave the call up; `cause` is its signal's reason. */
export class CancelledError extends MarbleError {}

/** An update of a session that a newer one overtook, and took the numbers of. */
export class SupersededError extends CancelledError {
  /** The update that took its place. */
  readonly bySequence: number;
  constructor(bySequence: number) {
    super("cancelled", `update ${bySequence} took its place`);
    this.bySequence = bySequence;
  }
}

/** The server does not know who calls, or the caller may not do this. */
export class AccessError extends MarbleError {}

/** Never heard of the job, no longer kept, or not the caller's to see. */
export class NotFoundError extends MarbleError {}

/** It does not fit what came before: the answer of a job that has not finished, an update after a session's end. */
export class PreconditionError extends MarbleError {}

/** The server ended a session that was idle for too long. */
export class AbortedError extends MarbleError {}

/** A bug of the server; the message carries the job id to look for in its log. */
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

/** The error of the class that belongs to its code. */
export function errorOf(code: ErrorCode, message: string, details: ErrorDetails = {}): MarbleError {
  return new classes[code](code, message, details);
}

/** "A.values[3] = NaN: must be finite". */
export function invalid(field: string, bound: string, at: { index?: number; value?: unknown } = {}): MarbleError {
  const place = at.index === undefined ? field : `${field}[${at.index}]`;
  const value = at.value === undefined ? undefined : String(at.value);
  const message = value === undefined ? `${place}: ${bound}` : `${place} = ${value}: ${bound}`;
  return errorOf("invalid_argument", message, { field, index: at.index, value, bound });
}

/** Does what may throw an InvalidProblemError of a part, whose field then is below `path`. */
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
