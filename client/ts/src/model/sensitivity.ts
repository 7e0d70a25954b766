import { type MarbleError, errorOf, invalid } from "../errors.js";
import { packDoubles, unpackDoubles, unpackIntegers } from "../packed.js";
import { matrixValues, vectors } from "../shared/tables.js";
import type { Fault } from "../generated/marble/v1/fault.js";
import {
  AnswerVectors,
  type ProblemNumbers,
  type SensitivityRequest as RequestMessage,
  type RowResponse as RowsMessage,
  type Sensitivity as Message,
} from "../generated/marble/v1/sensitivity.js";
import { type Matrix, takeMatrix, takeValues, takeVector } from "./matrix.js";
import { type ProblemUpdate, type Shape, sparse } from "./problem.js";

/** A change of the problem's data, in the form of an update; absent parts are zero. For Q the upper triangle counts. */
export type Direction = Omit<ProblemUpdate, "c0">;

/** The derivatives of a loss with respect to the vectors of a solution; absent parts are zero. */
export type AnswerWeights = Partial<Record<AnswerPart, ArrayLike<number>>>;

/** Rows E z whose response to multipliers is requested, for solvers of problems coupled by such rows. */
export interface RowsRequest {
  /** m × n, m ≥ 1. */
  E: Matrix;
  /** n numbers ≥ 0: a diagonal contained in Q that the response must exclude. Costs one factorization more. */
  proximal?: ArrayLike<number>;
  /** n entries: the linear cost for `free` and `z`, instead of the problem's. */
  g?: ArrayLike<number>;
  /** Whether to return `z` and `columns`; default false. */
  columns?: boolean;
}

/** Requested derivatives of a solution on its branch, where active rows stay active. */
export interface SensitivityRequest {
  /** Forward mode: the change of the solution along each direction. */
  directions?: readonly Direction[];
  /** Adjoint mode: the gradient of each loss with respect to all data of the problem. */
  losses?: readonly AnswerWeights[];
  rows?: RowsRequest;
}

/** The change of a solution's vectors by one unit of a direction. */
export interface AnswerChange extends Record<AnswerPart, Float64Array> {
  /** Whether the active set stays constant for small positive steps; always true if the sensitivity is smooth. */
  activeSetConstant: boolean;
}

/**
 * The gradient of a loss with respect to a problem's data; for matrices, to their entries in compressed-column order.
 */
export type ProblemGradient = Record<keyof typeof vectors | keyof typeof matrixValues, Float64Array>;

/** With the cost μᵀE z added, the branch has E z = free − response μ and the point z − columns μ. */
export interface RowResponse {
  /** E z at the solution, m entries. */
  values: Float64Array;
  /** E z at μ = 0 without the proximal term and with the requested cost, m entries. */
  free: Float64Array;
  /** m rows of m entries; symmetric, positive semidefinite. */
  response: Float64Array[];
  /** n entries if `columns` was requested; else empty. */
  z: Float64Array;
  /** m columns of n entries if requested; else empty. */
  columns: Float64Array[];
}

/** The requested derivatives. All clients return the same bits. */
export interface SensitivityAnswer {
  /**
   * Why there are no derivatives: the problem is not solved, or the solution is not an isolated exact one of a branch.
   */
  error?: MarbleError;
  /** Active rows of C with a zero multiplier (to 1e-6, scaled): a small change may deactivate them. */
  weakInequalities: Int32Array;
  /** Pairs with both sides at zero, either of which may become positive. */
  biactivePairs: Int32Array;
  /**
   * Whether there are no such rows and pairs. Else derivatives are the branch's; `activeSetConstant` marks for which directions.
   */
  smooth: boolean;
  /** One per direction; undefined if the branch is flat along it, or if dependent rows contradict it. */
  changes: (AnswerChange | undefined)[];
  /** One per loss; undefined if its multipliers are not unique or the branch is flat. */
  gradients: (ProblemGradient | undefined)[];
  /** Present if requested. */
  rows?: RowResponse;
  /** Why `rows` is absent: the branch is flat along a row, or not convex without the proximal diagonal. */
  rowsError?: MarbleError;
  /** 0 if the solve ended with the factor of the branch. Included in the solution's `factorizations`. */
  factorizations: number;
  /** Solves with a factor. */
  backSubstitutions: number;
}

/** The vectors of a solution. */
export type AnswerPart = keyof AnswerVectors;

const answerParts = Object.keys(AnswerVectors.fromPartial({})) as AnswerPart[];

/** The message of a request; throws an InvalidProblemError if a part does not fit the problem. */
export function sensitivityMessage(request: SensitivityRequest, shape: Shape): RequestMessage {
  const { directions = [], losses = [], rows } = request;
  const { variables: n, equalities, inequalities, pairs } = shape;
  const sizes = { g: n, b: equalities, d: inequalities, l: pairs, r: pairs };
  const numbers = {} as ProblemNumbers;
  for (const letter of keys(vectors)) {
    const take = (values: ArrayLike<number>, field: string) => takeVector(field, values, sizes[letter], "the problem");
    numbers[vectors[letter]] = packed("directions", directions, letter, sizes[letter], take);
  }
  for (const letter of keys(matrixValues)) {
    const pattern = shape.matrices[letter];
    const take = (values: Matrix | ArrayLike<number>, field: string) => {
      if (pattern === undefined) throw invalid(field, "is not part of the problem");
      return takeValues(field, values, pattern, "the problem");
    };
    numbers[matrixValues[letter]] = packed("directions", directions, letter, pattern?.values.length ?? 0, take);
  }
  const weights = {} as AnswerVectors;
  const sizesOfAnswer: Record<AnswerPart, number> = {
    z: n,
    equalityMultipliers: equalities,
    inequalityMultipliers: inequalities,
    complementarityMultipliersL: pairs,
    complementarityMultipliersR: pairs,
  };
  for (const part of answerParts) {
    const size = sizesOfAnswer[part];
    const take = (values: ArrayLike<number>, field: string) => takeVector(field, values, size, "the problem");
    weights[part] = packed("losses", losses, part, size, take);
  }
  const vector = (name: "proximal" | "g"): Uint8Array => {
    const values = rows?.[name];
    return values ? packDoubles(takeVector(`sensitivity.rows.${name}`, values, n, "variables")) : new Uint8Array(0);
  };
  return {
    directions: directions.length > 0 ? { count: directions.length, numbers } : undefined,
    losses: losses.length > 0 ? { count: losses.length, weights } : undefined,
    rows: rows && {
      matrix: sparse(takeMatrix("sensitivity.rows.E", rows.E, n)),
      proximal: vector("proximal"),
      gradient: vector("g"),
      columns: rows.columns ?? false,
    },
  };
}

/** The derivatives in a message, for a problem with `n` variables. */
export function sensitivityOf(message: Message, n: number): SensitivityAnswer {
  const weakInequalities = unpackIntegers(message.weakInequalities);
  const biactivePairs = unpackIntegers(message.biactivePairs);
  const rowsFault = message.rows?.error;
  return {
    error: message.error && errorOfFault(message.error),
    weakInequalities,
    biactivePairs,
    smooth: message.error === undefined && weakInequalities.length + biactivePairs.length === 0,
    changes: changesOf(message),
    gradients: gradientsOf(message, n),
    rows: message.rows && !rowsFault ? rowsOf(message.rows) : undefined,
    rowsError: rowsFault && errorOfFault(rowsFault),
    factorizations: message.factorizations,
    backSubstitutions: message.backSubstitutions,
  };
}

// This part of all directions or losses in order, zero where absent; empty if none has it.
function packed<Name extends string, Values>(
  kind: string,
  given: readonly Partial<Record<Name, Values>>[],
  name: Name,
  size: number,
  take: (values: Values, field: string) => Float64Array,
): Uint8Array {
  if (given.every((one) => one[name] === undefined)) return new Uint8Array(0);
  const all = new Float64Array(given.length * size);
  given.forEach((one, k) => {
    const values = one[name];
    if (values !== undefined) all.set(take(values, `sensitivity.${kind}[${k}].${name}`), k * size);
  });
  return packDoubles(all);
}

function changesOf({ changes }: Message): (AnswerChange | undefined)[] {
  if (changes?.vectors === undefined) return [];
  const { vectors: all, activeSetConstant } = changes;
  const missing = new Set(unpackIntegers(changes.undefined));
  const names = Object.fromEntries(answerParts.map((part) => [part, part])) as { [Part in AnswerPart]: Part };
  const parts = split(names, all, activeSetConstant.length);
  return parts.map((part, k) => (missing.has(k) ? undefined : { ...part, activeSetConstant: activeSetConstant[k] }));
}

function gradientsOf({ gradients }: Message, n: number): (ProblemGradient | undefined)[] {
  if (gradients?.numbers === undefined) return [];
  const missing = new Set(unpackIntegers(gradients.undefined));
  const count = unpackDoubles(gradients.numbers.gradient).length / n;
  const parts = split({ ...vectors, ...matrixValues }, gradients.numbers, count);
  return parts.map((part, k) => (missing.has(k) ? undefined : part));
}

// Splits every field into `count` equal parts, named by the table.
function split<Name extends string, Field extends string>(
  table: Record<Name, Field>,
  message: Record<Field, Uint8Array>,
  count: number,
): Record<Name, Float64Array>[] {
  const shares = Array.from({ length: count }, () => ({}) as Record<Name, Float64Array>);
  for (const name of keys(table)) {
    const all = unpackDoubles(message[table[name]]);
    const size = all.length / count;
    shares.forEach((share, k) => (share[name] = all.subarray(k * size, (k + 1) * size)));
  }
  return shares;
}

function rowsOf(message: RowsMessage): RowResponse {
  const values = unpackDoubles(message.values);
  const upper = unpackDoubles(message.response); // by columns: S_ij at i + j (j + 1) / 2 for i ≤ j
  const [z, columns, m] = [unpackDoubles(message.z), unpackDoubles(message.columns), values.length];
  const entry = (i: number, j: number): number => upper[Math.min(i, j) + (Math.max(i, j) * (Math.max(i, j) + 1)) / 2];
  return {
    values,
    free: unpackDoubles(message.free),
    response: Array.from({ length: m }, (_, i) => Float64Array.from({ length: m }, (_, j) => entry(i, j))),
    z,
    columns: z.length > 0 ? Array.from({ length: m }, (_, j) => columns.subarray(j * z.length, (j + 1) * z.length)) : [],
  };
}

function errorOfFault({ field, index, value, bound }: Fault): MarbleError {
  const place = index === undefined ? field : `${field}[${index}]`;
  const message = value === "" ? `${place}: ${bound}` : `${place} = ${value}: ${bound}`;
  return errorOf("failed_precondition", message, { field, index, value: value === "" ? undefined : value, bound });
}

function keys<Key extends string>(table: Record<Key, unknown>): Key[] {
  return Object.keys(table) as Key[];
}
