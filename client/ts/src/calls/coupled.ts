import { secondsOrZero, wholeOrZero } from "../base/checks.js";
import { errorOf, invalid, within } from "../base/errors.js";
import { packDoubles, packIntegers, unpackDoubles } from "../base/packed.js";
import { word } from "../base/words.js";
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

/** One problem, and what the rows between blocks see of it. */
export interface CoupledBlock {
  /** Of n_k variables. Its name is for people, in what is told of it; its x0 is not looked at. */
  problem: Problem;
  /** E_k, m × n_k; absent where no row sees the block. */
  coupling?: Matrix;
}

/** Problems that rows tie together: min Σ f_k(z_k), each z_k feasible for its own block, Σ E_k z_k = total. */
export interface CoupledProblem {
  /** For logs and dashboards; at most 256 bytes. */
  name?: string;
  /** At least one. */
  blocks: CoupledBlock[];
  /** m numbers. */
  total: ArrayLike<number>;
}

/** How one long problem is cut, whose x0 is not looked at. */
export interface Pieces {
  /** Of each variable its stage, from 0 on. */
  stages: ArrayLike<number>;
  /** How many, of equal length, ≥ 1. */
  pieces: number;
  /** Stages that each looks ahead while they are first solved one after the other; default: a third of one, but ≥ 2. */
  lookAhead?: number;
}

/** How blocks are brought to agree; all of it optional. `options` hold for every block's solves and the joint one. */
export interface PiecesControls extends CommonControls, CallControls {
  /** First ρ > 0 of ½ρ|E_k(y − z)|², what holds a block where the last iteration was; default 1, of pieces 100. */
  proximal?: number;
  /** Iterations of the coordinator, ≥ 1; default 60. */
  maxIterations?: number;
  /** After so many every pair keeps its side, ≥ 1, of pieces ≥ 0; default 15, of pieces 0. */
  freezeAfter?: number;
  /** How often blocks that agree look for better branches, ≥ 0; default 3. */
  searches?: number;
  /** Pairs of frozen blocks that may be tried on their other side, ≥ 0; default 20. */
  flips?: number;
  /** Of the rows and of the last step, relative, in (0, 1); default 1e-9, of pieces 1e-8. */
  tolerance?: number;
  /** Whether the branch is solved as one problem at the end, exactly; default true, and of pieces it must be. */
  joint?: boolean;
  /** Whether better branches are looked for before that; default true, of pieces false. */
  jointSearch?: boolean;
  /**
   * Called for every iteration: `objective` of the blocks, in `violations.equality` that of the rows, in `kktResidual` the
   * largest step of a price, `rho`, `factorizations`.
   */
  onProgress?: (row: Progress) => void;
  /** Least time between two rows of progress, in seconds; 0, the default, tells every iteration. */
  progressIntervalS?: number;
}

/** The same of blocks. */
export interface CoupledControls extends PiecesControls {
  /** Of the rows, to begin with, m; default zeros. */
  prices?: ArrayLike<number>;
}

/** How the blocks came to agree, or did not. */
export interface Coordination extends Omit<CoupledOutcome, "status" | "prices"> {
  /** "solved": they agree; "iteration_limit": not yet. Else that of the block which failed. */
  status: Status | "unknown";
}

/** The answer to blocks. */
export interface CoupledAnswer {
  /** Of each block. */
  z: Float64Array[];
  /** λ of the rows, m. */
  prices: Float64Array;
  /** Of the joint problem: the blocks' vectors one after the other, the prices the last equality multipliers. */
  solution: Solution;
  coordination: Coordination;
}

/** The answer to a problem in pieces. */
export interface PiecesAnswer {
  /** Of the problem itself. */
  solution: Solution;
  coordination: Coordination;
}

export async function coupled(
  connection: Connection,
  problem: CoupledProblem,
  controls: CoupledControls,
): Promise<CoupledAnswer> {
  return coupledAnswerOf(await answer(connection, coupledRequest(problem, controls), controls), problem.blocks);
}

export async function pieces(
  connection: Connection,
  problem: Problem,
  cut: Pieces,
  controls: PiecesControls,
): Promise<PiecesAnswer> {
  return piecesAnswerOf(await answer(connection, piecesRequest(problem, cut, controls), controls));
}

async function answer(connection: Connection, solve: SolveRequest, controls: PiecesControls): Promise<SolveResponse> {
  const progressIntervalS = secondsOrZero("progressIntervalS", controls.progressIntervalS);
  const request = { solve, progressIntervalS, iterateEvery: 0 };
  const messages = serverStream(connection, SolverService.solveCoupled, request, controls, connection.deadlineMs);
  for await (const { event } of messages) {
    if (event?.$case === "progress" && controls.onProgress) event.value.rows.map(progressOf).forEach(controls.onProgress);
    if (event?.$case === "result") return event.value;
  }
  throw errorOf("internal", "the server ended the call without an answer");
}

/** Throws an InvalidProblemError, and sends nothing then. */
export function coupledRequest({ name, blocks, total }: CoupledProblem, controls: CoupledControls): SolveRequest {
  if (!Array.isArray(blocks) || blocks.length === 0) {
    throw invalid("coupled.blocks", "must be an array of at least one", { value: blocks });
  }
  const rows = total?.length ?? 0;
  const message = settingsOf(controls);
  message.total = packDoubles(takeVector("coupled.total", total, rows, "rows"));
  if (controls.prices !== undefined) {
    message.prices = packDoubles(takeVector("coupled.prices", controls.prices, rows, "rows, as total has"));
  }
  message.blocks = blocks.map((block, k) => within(`coupled.blocks[${k}]`, () => blockOf(block, rows)));
  return { ...requestOf(ProblemMessage.fromPartial({ name: name ?? "" }), controls), coupled: message };
}

function blockOf({ problem, coupling }: CoupledBlock, rows: number): BlockMessage {
  const { message, shape } = within("problem", () => checkProblem(problem));
  if (coupling === undefined) return { problem: message, coupling: undefined };
  const taken = takeMatrix("coupling", coupling, shape.variables);
  if (taken.rows !== rows) throw invalid("coupling.rows", `must be ${rows}, as many as total has`, { value: taken.rows });
  return { problem: message, coupling: sparse(taken) };
}

/** The same of pieces. */
export function piecesRequest(problem: Problem, cut: Pieces, controls: PiecesControls): SolveRequest {
  const request = solveRequest({ ...problem, x0: undefined }, controls);
  const stages = takeVector("coupled.pieces.stages", cut.stages, problem.g.length, "variables");
  stages.forEach((value, index) => {
    if (Number.isInteger(value) && value >= 0 && value <= 0x7fffffff) return;
    throw invalid("coupled.pieces.stages", "must be a whole number in [0, 2^31)", { index, value });
  });
  const count = wholeOrZero("coupled.pieces.pieces", cut.pieces);
  const { lookAhead } = cut;
  if (lookAhead !== -1) wholeOrZero("coupled.pieces.lookAhead", lookAhead);
  const message = settingsOf(controls);
  message.pieces = { stages: packIntegers(Int32Array.from(stages)), pieces: count, lookAhead };
  return { ...request, coupled: message };
}

function settingsOf(controls: PiecesControls): Message {
  const { proximal, maxIterations, freezeAfter, searches, flips, tolerance, joint, jointSearch } = controls;
  for (const [field, value] of Object.entries({ proximal, tolerance })) {
    if (value !== undefined && typeof value !== "number") throw invalid(`coupled.${field}`, "must be a number", { value });
  }
  for (const [field, value] of Object.entries({ maxIterations, freezeAfter, searches, flips })) {
    wholeOrZero(`coupled.${field}`, value);
  }
  const settings = { proximal, maxIterations, freezeAfter, searches, flips, tolerance, joint, jointSearch };
  return { ...Message.fromPartial({}), ...settings };
}

/** Blocks as they were given: their sizes say whose numbers are whose. */
export function coupledAnswerOf(response: SolveResponse, blocks: CoupledBlock[]): CoupledAnswer {
  const { solution, coordination, prices } = answerOf(response);
  let first = 0;
  const z = blocks.map(({ problem }) => solution.z.slice(first, (first += problem.g.length)));
  if (first !== solution.z.length) {
    throw invalid("blocks", `must have ${solution.z.length} variables, as the answer has`, { value: first });
  }
  return { z, prices, solution, coordination };
}

export function piecesAnswerOf(response: SolveResponse): PiecesAnswer {
  const { solution, coordination } = answerOf(response);
  return { solution, coordination };
}

function answerOf(response: SolveResponse): PiecesAnswer & { prices: Float64Array } {
  const message = expect(response.solution);
  if (message.coupled === undefined) {
    throw errorOf("failed_precondition", "coupled is not in this answer: its problem was solved alone");
  }
  const { prices, status, ...rest } = message.coupled;
  const coordination = { ...rest, status: word(StatusNumber, "STATUS_", status) ?? ("unknown" as const) };
  return { solution: new Solution(response.jobId, message), coordination, prices: unpackDoubles(prices) };
}
