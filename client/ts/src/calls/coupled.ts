import { secondsOrZero, wholeOrZero } from "../checks.js";
import { errorOf, invalid, within } from "../errors.js";
import { packDoubles, packIntegers, unpackDoubles } from "../packed.js";
import { word } from "../words.js";
import type { Connection } from "../connection/connection.js";
import { Coupled as Message, type CoupledBlock as BlockMessage } from "../generated/marble/v1/coupled.js";
import { Problem as ProblemMessage } from "../generated/marble/v1/problem.js";
import { type SolveRequest, type SolveResponse, SolverService } from "../generated/marble/v1/service.js";
import { type CoupledOutcome, Status as StatusNumber } from "../generated/marble/v1/solution.js";
import { type Matrix, takeMatrix, takeVector } from "../model/matrix.js";
import { type Problem, checkProblem, sparse } from "../model/problem.js";
import { type Progress, progressOf } from "../model/progress.js";
import { Solution, type Status } from "../model/solution.js";
import { type CallControls, serverStream } from "./calls.js";
import { type CommonControls, expect, requestOf, solveRequest } from "./solve.js";

/** One block of a coupled problem. */
export interface CoupledBlock {
  /** A problem with n_k variables. Its x0 is ignored; its name appears in messages. */
  problem: Problem;
  /** E_k, m × n_k; absent if no coupling row contains the block. */
  coupling?: Matrix;
}

/** Problems coupled by rows: min Σ f_k(z_k), each z_k feasible for its block, Σ E_k z_k = couplingRhs. */
export interface CoupledProblem {
  /** For logs and dashboards; at most 256 bytes. */
  name?: string;
  /** At least one. */
  blocks: CoupledBlock[];
  /** The right-hand side of the coupling rows, m entries. */
  couplingRhs: ArrayLike<number>;
}

/** The segments of a long problem, whose x0 is ignored. */
export interface Segments {
  /** The stage of each variable, from 0. */
  stages: ArrayLike<number>;
  /** The number of segments of equal length, ≥ 1. */
  numSegments: number;
  /** Overlap of the segments in the initial forward pass, in stages; default: a third of a segment, at least 2. */
  overlap?: number;
}

/**
 * Parameters of the coordination. All are optional. `options` apply to the blocks' solves and to the monolithic one.
 */
export interface SegmentsControls extends CommonControls, CallControls {
  /** Initial ρ > 0 of the proximal term ½ρ|E_k(y − z)|² of each block; default 1, for segments 100. */
  proximal?: number;
  /** Maximum number of coordination iterations, ≥ 1; default 60. */
  maxIterations?: number;
  /** Iterations after which pairs keep their active side, ≥ 1, for segments ≥ 0; default 15, for segments 0. */
  freezeAfter?: number;
  /** Maximum number of branch searches after the blocks agree, ≥ 0; default 3. */
  maxSearches?: number;
  /** Maximum number of pairs to switch in frozen blocks, ≥ 0; default 20. */
  maxPairSwitches?: number;
  /** Relative tolerance of the coupling rows and of the last step, in (0, 1); default 1e-9, for segments 1e-8. */
  tolerance?: number;
  /** Whether the final branch is solved exactly as a monolithic problem; default true, required for segments. */
  monolithic?: boolean;
  /** Whether the monolithic problem searches for better branches; default true, for segments false. */
  monolithicSearch?: boolean;
  /**
   * Called for every iteration: `objective` of the blocks, violation of the coupling rows in `violations.equality`,
   * largest step of a multiplier in `kktResidual`, `rho`, `factorizations`.
   */
  onProgress?: (row: Progress) => void;
  /** Minimum time between two rows of progress, in seconds; default 0: every iteration. */
  progressIntervalS?: number;
}

/** Parameters for coupled blocks. */
export interface CoupledControls extends SegmentsControls {
  /** Initial multipliers of the coupling rows, m entries; default zeros. */
  couplingMultipliers?: ArrayLike<number>;
}

/** The result of the coordination. */
export interface Coordination extends Omit<CoupledOutcome, "status" | "couplingMultipliers"> {
  /** "solved" if the blocks agree, "iteration_limit" if not yet; otherwise the status of the block that failed. */
  status: Status | "unknown";
}

/** The solution of a coupled problem. */
export interface CoupledSolution {
  /** The variables of each block. */
  z: Float64Array[];
  /** Multipliers λ of the coupling rows, m entries. */
  couplingMultipliers: Float64Array;
  /**
   * The solution of the monolithic problem: the blocks' vectors in order; `couplingMultipliers` are its last equality multipliers.
   */
  solution: Solution;
  coordination: Coordination;
}

/** The solution of a problem in segments. */
export interface SegmentsAnswer {
  /** The solution of the whole problem. */
  solution: Solution;
  coordination: Coordination;
}

export async function coupled(
  connection: Connection,
  problem: CoupledProblem,
  controls: CoupledControls,
): Promise<CoupledSolution> {
  return coupledSolutionOf(await answer(connection, coupledRequest(problem, controls), controls), problem.blocks);
}

export async function segments(
  connection: Connection,
  problem: Problem,
  cut: Segments,
  controls: SegmentsControls,
): Promise<SegmentsAnswer> {
  return segmentsAnswerOf(await answer(connection, segmentsRequest(problem, cut, controls), controls));
}

async function answer(connection: Connection, solve: SolveRequest, controls: SegmentsControls): Promise<SolveResponse> {
  const progressIntervalS = secondsOrZero("progressIntervalS", controls.progressIntervalS);
  const request = { solve, progressIntervalS, iterateEvery: 0 };
  const messages = serverStream(connection, SolverService.solveCoupled, request, controls, connection.deadlineMs);
  for await (const { event } of messages) {
    if (event?.$case === "progress" && controls.onProgress) event.value.rows.map(progressOf).forEach(controls.onProgress);
    if (event?.$case === "result") return event.value;
  }
  throw errorOf("internal", "the server ended the call without a result");
}

/** Throws an InvalidProblemError before anything is sent. */
export function coupledRequest({ name, blocks, couplingRhs }: CoupledProblem, controls: CoupledControls): SolveRequest {
  if (!Array.isArray(blocks) || blocks.length === 0) {
    throw invalid("coupled.blocks", "must be an array of at least one", { value: blocks });
  }
  const rows = couplingRhs?.length ?? 0;
  const message = settingsOf(controls);
  message.couplingRhs = packDoubles(takeVector("coupled.couplingRhs", couplingRhs, rows, "rows"));
  if (controls.couplingMultipliers !== undefined) {
    message.couplingMultipliers = packDoubles(takeVector("coupled.couplingMultipliers", controls.couplingMultipliers, rows, "rows, as couplingRhs has"));
  }
  message.blocks = blocks.map((block, k) => within(`coupled.blocks[${k}]`, () => blockOf(block, rows)));
  return { ...requestOf(ProblemMessage.fromPartial({ name: name ?? "" }), controls), coupled: message };
}

function blockOf({ problem, coupling }: CoupledBlock, rows: number): BlockMessage {
  const { message, shape } = within("problem", () => checkProblem(problem));
  if (coupling === undefined) return { problem: message, coupling: undefined };
  const taken = takeMatrix("coupling", coupling, shape.variables);
  if (taken.rows !== rows) throw invalid("coupling.rows", `must be ${rows}, as many as couplingRhs has`, { value: taken.rows });
  return { problem: message, coupling: sparse(taken) };
}

/** The same for segments. */
export function segmentsRequest(problem: Problem, cut: Segments, controls: SegmentsControls): SolveRequest {
  const request = solveRequest({ ...problem, x0: undefined }, controls);
  const stages = takeVector("coupled.segments.stages", cut.stages, problem.g.length, "variables");
  stages.forEach((value, index) => {
    if (Number.isInteger(value) && value >= 0 && value <= 0x7fffffff) return;
    throw invalid("coupled.segments.stages", "must be a whole number in [0, 2^31)", { index, value });
  });
  const count = wholeOrZero("coupled.segments.numSegments", cut.numSegments);
  const { overlap } = cut;
  if (overlap !== -1) wholeOrZero("coupled.segments.overlap", overlap);
  const message = settingsOf(controls);
  message.segments = { stages: packIntegers(Int32Array.from(stages)), numSegments: count, overlap };
  return { ...request, coupled: message };
}

function settingsOf(controls: SegmentsControls): Message {
  const { proximal, maxIterations, freezeAfter, maxSearches, maxPairSwitches, tolerance, monolithic, monolithicSearch } = controls;
  for (const [field, value] of Object.entries({ proximal, tolerance })) {
    if (value !== undefined && typeof value !== "number") throw invalid(`coupled.${field}`, "must be a number", { value });
  }
  for (const [field, value] of Object.entries({ maxIterations, freezeAfter, maxSearches, maxPairSwitches })) {
    wholeOrZero(`coupled.${field}`, value);
  }
  const settings = { proximal, maxIterations, freezeAfter, maxSearches, maxPairSwitches, tolerance, monolithic, monolithicSearch };
  return { ...Message.fromPartial({}), ...settings };
}

/** Splits a solution by the sizes of the blocks. */
export function coupledSolutionOf(response: SolveResponse, blocks: CoupledBlock[]): CoupledSolution {
  const { solution, coordination, couplingMultipliers } = answerOf(response);
  let first = 0;
  const z = blocks.map(({ problem }) => solution.z.slice(first, (first += problem.g.length)));
  if (first !== solution.z.length) {
    throw invalid("blocks", `must have ${solution.z.length} variables, as the solution has`, { value: first });
  }
  return { z, couplingMultipliers, solution, coordination };
}

export function segmentsAnswerOf(response: SolveResponse): SegmentsAnswer {
  const { solution, coordination } = answerOf(response);
  return { solution, coordination };
}

function answerOf(response: SolveResponse): SegmentsAnswer & { couplingMultipliers: Float64Array } {
  const message = expect(response.solution);
  if (message.coupled === undefined) {
    throw errorOf("failed_precondition", "this solution has no coordination: its problem was solved alone");
  }
  const { couplingMultipliers, status, ...rest } = message.coupled;
  const coordination = { ...rest, status: word(StatusNumber, "STATUS_", status) ?? ("unknown" as const) };
  return { solution: new Solution(response.jobId, message), coordination, couplingMultipliers: unpackDoubles(couplingMultipliers) };
}
