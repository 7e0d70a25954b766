/**
 * Client of Marble Server, a solver service for quadratic programs with linear complementarity constraints.
 *
 * @module
 */
export type { BatchAnswer, BatchControls, BatchProblem } from "./batch.js";
export { BuiltProblem, ProblemBuilder } from "./builder.js";
export type { Bounds, Expression, PairReport, Report, Term } from "./builder.js";
export type { CallControls } from "./calls.js";
export { Client, connect } from "./client.js";
export type { ConnectOptions, TlsOptions } from "./connect-options.js";
export {
  AbortedError,
  AccessError,
  CancelledError,
  DeadlineError,
  InternalError,
  InvalidProblemError,
  MarbleError,
  NotFoundError,
  PreconditionError,
  RefusedError,
  SupersededError,
  UnavailableError,
} from "./errors.js";
export type { ErrorCode, ErrorDetails } from "./errors.js";
export type { Counters, Limits, OptionSchema, Quota, ServerInfo } from "./info.js";
export { Jobs } from "./jobs.js";
export type {
  JobDetails,
  JobEvent,
  JobInfo,
  JobKind,
  JobPage,
  JobQuery,
  JobState,
  PairSides,
  ResultControls,
  SubmittedJob,
  Trace,
  WatchControls,
} from "./jobs.js";
export type { CompressedColumns, DenseRows, Matrix, Triplets } from "./matrix.js";
export type { SolveOptions } from "./options.js";
export type { Problem, ProblemUpdate } from "./problem.js";
export type { Progress, Tree, Violations } from "./progress.js";
export { Session, shiftByStage } from "./session.js";
export type { SessionControls, Shift, ShiftBlock, UpdateControls } from "./session.js";
export { Solution } from "./solution.js";
export type { SecondOrder, Stationarity, Status, Times } from "./solution.js";
export type { Priority, RequestControls, SolveControls, SolveEvent, StreamControls } from "./solve.js";
