/**
 * Client of Marble Server, a solver service for quadratic programs with linear complementarity constraints.
 *
 * @module
 */
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
export type { SolutionKind } from "./shared/solution-kind.js";
export type { ArrayAnswer, ArrayControls, ArrayElement, ArrayReading, SubmittedArray } from "./calls/array.js";
export type { BatchAnswer, BatchControls, BatchProblem } from "./calls/batch.js";
export type { CallControls } from "./calls/calls.js";
export type {
  Coordination,
  CoupledSolution,
  CoupledBlock,
  CoupledControls,
  CoupledProblem,
  Segments,
  SegmentsAnswer,
  SegmentsControls,
} from "./calls/coupled.js";
export type { Counters, Limits, OptionSchema, Quota, ServerInfo } from "./calls/info.js";
export { Jobs } from "./calls/jobs.js";
export type {
  Infeasibility,
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
} from "./calls/jobs.js";
export type {
  ProblemPart,
  ScenarioSolution,
  ScenarioControls,
  ScenarioEntries,
  SampleAverageStage,
  ScenarioQuantity,
  ScenarioSamples,
} from "./calls/scenarios.js";
export { Session } from "./calls/session.js";
export type { Reopening, SessionControls } from "./calls/session.js";
export { shiftByStage } from "./calls/session-update.js";
export type { Shift, ShiftBlock, UpdateControls } from "./calls/session-update.js";
export type { CommonControls, Priority, RequestControls, SolveControls, SolveEvent, StreamControls } from "./calls/solve.js";
export { Client, connect } from "./client.js";
export type { ConnectOptions, Keepalive, TlsOptions } from "./connection/connect-options.js";
export { BuiltProblem, ProblemBuilder } from "./model/builder.js";
export type { Bounds, Expression, PairReport, Report, Term } from "./model/builder.js";
export type { CompressedColumns, DenseRows, Matrix, Triplets } from "./model/matrix.js";
export type { SolveOptions } from "./model/options.js";
export type { Problem, ProblemUpdate } from "./model/problem.js";
export type { Progress, Tree, Violations } from "./model/progress.js";
export type {
  AnswerChange,
  AnswerPart,
  AnswerWeights,
  Direction,
  ProblemGradient,
  RowResponse,
  RowsRequest,
  SensitivityAnswer,
  SensitivityRequest,
} from "./model/sensitivity.js";
export { Solution } from "./model/solution.js";
export type { Conflict, PointOrigin, SecondOrder, Stationarity, Status, Times } from "./model/solution.js";
