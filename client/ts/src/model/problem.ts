import { invalid } from "../errors.js";
import { packDoubles, packIntegers } from "../packed.js";
import { matrices as matrixFields, matrixValues, offsets, vectors } from "../shared/tables.js";
import { type Words, valueOf, words } from "../words.js";
import { HessianForm, type Problem as Message, type SparseMatrix } from "../generated/marble/v1/problem.js";
import type { ProblemUpdate as UpdateMessage } from "../generated/marble/v1/session.js";
import { type Csc, type Matrix, checkSymmetric, takeMatrix, takeValues, takeVector } from "./matrix.js";

/**
 * A quadratic program with linear complementarity constraints:
 *
 * ```text
 * min ½ zᵀQz + gᵀz + c0   s.t.   A z + b = 0,   C z + d ≥ 0,   0 ≤ L z + l  ⊥  R z + r ≥ 0
 * ```
 *
 * Only g is required. The JSON object of a problem file is a Problem. Calls copy the arrays.
 */
export interface Problem {
  /** For logs and dashboards; at most 256 bytes. */
  name?: string;
  /** n × n, symmetric; default zero. */
  Q?: Matrix;
  /** "upper_triangle" if Q contains only entries with row ≤ column; default "full". */
  hessianForm?: Words<typeof HessianForm, "HESSIAN_FORM_">;
  /** n ≥ 1 entries. */
  g: ArrayLike<number>;
  /** Constant of the objective; default 0. */
  c0?: number;
  A?: Matrix;
  /** One entry per row of A; default zeros. The same applies to d, l and r. */
  b?: ArrayLike<number>;
  C?: Matrix;
  d?: ArrayLike<number>;
  L?: Matrix;
  l?: ArrayLike<number>;
  /** As many rows as L. */
  R?: Matrix;
  r?: ArrayLike<number>;
  /** n entries: the default starting point. */
  x0?: ArrayLike<number> | null;
}

/** New data for a problem with the same sizes and patterns. Absent parts stay as they are. */
export interface ProblemUpdate {
  c0?: number;
  g?: ArrayLike<number>;
  b?: ArrayLike<number>;
  d?: ArrayLike<number>;
  l?: ArrayLike<number>;
  r?: ArrayLike<number>;
  /** A matrix within the pattern of the old one, or only its values in the order of compressed columns. */
  Q?: Matrix | ArrayLike<number>;
  A?: Matrix | ArrayLike<number>;
  C?: Matrix | ArrayLike<number>;
  L?: Matrix | ArrayLike<number>;
  R?: Matrix | ArrayLike<number>;
}

type MatrixName = keyof typeof matrixFields;

/** Sizes and patterns of a checked problem. */
export interface Shape {
  variables: number;
  equalities: number;
  inequalities: number;
  pairs: number;
  matrices: Partial<Record<MatrixName, Csc>>;
}

/** A checked problem as a message. */
export interface CheckedProblem {
  message: Message;
  shape: Shape;
}

/** Checks a problem; throws an InvalidProblemError that names field and index. */
export function checkProblem(problem: Problem): CheckedProblem {
  if (typeof problem !== "object" || problem === null)
    throw invalid("problem", "must be an object", { value: problem });
  const n = problem.g?.length ?? 0;
  if (n < 1) throw invalid("g", "must have at least 1 entry", { value: `${n} entries` });
  const matrices: Shape["matrices"] = {};
  for (const name of letters(matrixFields)) {
    const matrix = problem[name];
    if (matrix !== undefined) matrices[name] = takeMatrix(name, matrix, n);
  }
  const form = checkHessian(problem, matrices.Q, n);
  const message = {
    name: problem.name ?? "",
    hessianForm: form,
    constant: takeConstant(problem.c0),
    gradient: packDoubles(takeVector("g", problem.g, n, "variables")),
  } as Message;
  for (const letter of letters(matrixFields)) {
    message[matrixFields[letter]] = sparse(matrices[letter]);
    const offset = offsets[letter];
    if (offset === "g") continue;
    message[vectors[offset]] = packDoubles(takeOffset(offset, problem[offset], letter, matrices[letter]));
  }
  const pairs = matrices.L?.rows ?? 0;
  if ((matrices.R?.rows ?? 0) !== pairs) {
    throw invalid("R.rows", `must be ${pairs}, as many as L has`, { value: matrices.R?.rows ?? 0 });
  }
  const [equalities, inequalities] = [matrices.A?.rows ?? 0, matrices.C?.rows ?? 0];
  return { message, shape: { variables: n, equalities, inequalities, pairs, matrices } };
}

/** The message of an update; throws an InvalidProblemError if a part does not fit the set-up. */
export function updateMessage(update: ProblemUpdate, shape: Shape): UpdateMessage {
  const vector = (name: keyof typeof vectors, size: number): Uint8Array => {
    const values = update[name];
    return values === undefined ? absent : packDoubles(takeVector(name, values, size, "the set-up"));
  };
  const values = (name: MatrixName): Uint8Array => {
    const given = update[name];
    if (given === undefined) return absent;
    const pattern = shape.matrices[name];
    if (pattern === undefined) throw invalid(name, "is not part of the set-up");
    return packDoubles(takeValues(name, given, pattern));
  };
  const { variables, equalities, inequalities, pairs } = shape;
  const sizes = { g: variables, b: equalities, d: inequalities, l: pairs, r: pairs };
  const message = { constant: update.c0 === undefined ? undefined : takeConstant(update.c0) } as UpdateMessage;
  for (const letter of letters(vectors)) message[vectors[letter]] = vector(letter, sizes[letter]);
  for (const letter of letters(matrixValues)) message[matrixValues[letter]] = values(letter);
  return message;
}

function letters<Letter extends string>(table: Record<Letter, string>): Letter[] {
  return Object.keys(table) as Letter[];
}

const absent = new Uint8Array(0);

function checkHessian(problem: Problem, q: Csc | undefined, n: number): HessianForm {
  const form = valueOf(HessianForm, "HESSIAN_FORM_", problem.hessianForm);
  if (form === undefined) {
    const bound = `must be one of ${words(HessianForm, "HESSIAN_FORM_").join(", ")}`;
    throw invalid("hessianForm", bound, { value: problem.hessianForm });
  }
  if (q === undefined) return form;
  if (q.rows !== n) throw invalid("Q.rows", `must be ${n} (variables)`, { value: q.rows });
  if (form !== HessianForm.HESSIAN_FORM_UPPER_TRIANGLE) {
    checkSymmetric("Q", q);
    return form;
  }
  for (let column = 0; column < n; ++column) {
    const last = q.columnPointers[column + 1] - 1;
    if (last < q.columnPointers[column] || q.rowIndices[last] <= column) continue;
    throw invalid("Q", "must be the upper triangle", { value: `an entry at (${q.rowIndices[last]}, ${column})` });
  }
  return form;
}

function takeOffset(name: string, values: ArrayLike<number> | undefined, of: string, matrix?: Csc): Float64Array {
  const rows = matrix?.rows ?? 0;
  return values === undefined ? new Float64Array(rows) : takeVector(name, values, rows, `rows of ${of}`);
}

function takeConstant(c0: number | undefined): number {
  if (c0 !== undefined && !Number.isFinite(c0)) throw invalid("c0", "must be finite", { value: c0 });
  return c0 ?? 0;
}

/** The message of a checked matrix. */
export function sparse(matrix: Csc | undefined): SparseMatrix | undefined {
  return (
    matrix && {
      rows: matrix.rows,
      columns: matrix.columns,
      columnPointers: packIntegers(matrix.columnPointers),
      rowIndices: packIntegers(matrix.rowIndices),
      values: packDoubles(matrix.values),
    }
  );
}
