import { invalid } from "../base/errors.js";
import { type Csc, type Matrix, takeMatrix, takeValues, takeVector } from "../model/matrix.js";

/** What a plan's functions are at x. Parts that are left out have no rows. */
export interface Values {
  /** θ. */
  objective: number;
  /** Half the sum of their squares is added to θ. */
  residuals?: ArrayLike<number>;
  /** c_E(x), which shall be 0. */
  equalities?: ArrayLike<number>;
  /** c_I(x), which shall be at least 0. */
  inequalities?: ArrayLike<number>;
  /** The one side of the pairs 0 ≤ G ⊥ H ≥ 0. */
  G?: ArrayLike<number>;
  /** The other side, as many rows. */
  H?: ArrayLike<number>;
}

/**
 * First derivatives at x: a Jacobian for each part with rows, n columns. Patterns are those of the first call and stay: an
 * entry that may ever be other than zero must be there. All entries of a dense matrix are.
 */
export interface Derivatives {
  /** Of the objective, without the residuals; n entries. */
  gradient: ArrayLike<number>;
  residuals?: Matrix;
  equalities?: Matrix;
  inequalities?: Matrix;
  G?: Matrix;
  H?: Matrix;
}

/**
 * y, ν, ξ, η and those of the bounds, with ∇θ + ∇c_Eᵀ y − ∇c_Iᵀ ν − ∇Gᵀ ξ − ∇Hᵀ η − bounds = 0 at a solution: ν ≥ 0, and
 * of a lower bound ≥ 0, of an upper one ≤ 0.
 */
export interface Multipliers {
  equalities: Float64Array;
  inequalities: Float64Array;
  G: Float64Array;
  H: Float64Array;
  bounds: Float64Array;
}

/** min θ(x)  s.t.  c_E(x) = 0,  c_I(x) ≥ 0,  0 ≤ G(x) ⊥ H(x) ≥ 0,  lower ≤ x ≤ upper, as functions. */
export interface NonlinearProblem {
  /** Finite numbers, read before the next function is called. */
  values(x: Float64Array): Values;
  derivatives(x: Float64Array): Derivatives;
  /** Of θ + yᵀc_E − νᵀc_I − ξᵀG − ηᵀH. Its upper triangle is read, n × n. */
  hessian?(x: Float64Array, multipliers: Multipliers): Matrix;
  /** n ≥ 1 entries, the first x; moved into the bounds. */
  start: ArrayLike<number>;
  /** n entries; default −Infinity. */
  lower?: ArrayLike<number>;
  /** n entries; default Infinity. */
  upper?: ArrayLike<number>;
  /** n entries > 0: a typical change of each variable; default 1. */
  scale?: ArrayLike<number>;
}

/** The parts that are rows. */
export const rowParts = ["equalities", "inequalities", "G", "H"] as const;
export type RowPart = (typeof rowParts)[number];

/** The functions at one x, checked. */
export interface Point {
  objective: number;
  gradient: Float64Array;
  rows: Record<RowPart, Float64Array>;
  jacobians: Record<RowPart, Csc>;
  /** Of the residuals. */
  residuals: Csc;
}

/** Calls the functions, and holds them to the sizes and patterns of the first call. */
export class Functions {
  readonly start: Float64Array;
  readonly lower: Float64Array;
  readonly upper: Float64Array;
  readonly scale: Float64Array;
  private readonly patterns = new Map<string, Csc>();
  private readonly sizes = new Map<string, number>();

  constructor(private readonly problem: NonlinearProblem) {
    for (const name of ["values", "derivatives"] as const)
      if (typeof problem[name] !== "function") throw invalid(name, "must be a function", { value: problem[name] });
    const n = problem.start?.length ?? 0;
    if (n < 1) throw invalid("start", "must have at least 1 entry", { value: `${n} entries` });
    this.start = takeVector("start", problem.start, n, "variables");
    this.lower = limits("lower", problem.lower, n, -Infinity);
    this.upper = limits("upper", problem.upper, n, Infinity);
    this.scale = limits("scale", problem.scale, n, 1);
    for (let index = 0; index < n; ++index) {
      const [low, up, scale] = [this.lower[index], this.upper[index], this.scale[index]];
      if (!(low <= up)) throw invalid("lower", `must be <= upper, ${up}`, { index, value: low });
      if (!(scale > 0 && scale < Infinity)) throw invalid("scale", "must be finite and > 0", { index, value: scale });
      this.start[index] = Math.min(Math.max(this.start[index], low), up);
    }
  }

  /** Throws an InvalidProblemError that names function, part and row. */
  at(x: Float64Array): Point {
    const n = x.length;
    const values = given("values", this.problem.values(x.slice()));
    const rows = {} as Point["rows"];
    for (const part of rowParts) rows[part] = this.vector(`values.${part}`, values[part] ?? []);
    if (rows.H.length !== rows.G.length)
      throw invalid("values.H", `must have as many rows as G, ${rows.G.length}`, { value: `${rows.H.length} entries` });
    const residuals = this.vector("values.residuals", values.residuals ?? []);
    const objective = residuals.reduce((sum, residual) => sum + 0.5 * residual * residual, values.objective);
    if (!Number.isFinite(objective)) throw invalid("values.objective", "must be finite", { value: values.objective });

    const derivatives = given("derivatives", this.problem.derivatives(x.slice()));
    const gradient = takeVector("derivatives.gradient", derivatives.gradient, n, "variables");
    const jacobians = {} as Point["jacobians"];
    for (const part of rowParts)
      jacobians[part] = this.matrix(`derivatives.${part}`, derivatives[part], rows[part].length, n);
    const ofResiduals = this.matrix("derivatives.residuals", derivatives.residuals, residuals.length, n);
    for (let column = 0; column < n; ++column) {
      for (let k = ofResiduals.columnPointers[column]; k < ofResiduals.columnPointers[column + 1]; ++k)
        gradient[column] += ofResiduals.values[k] * residuals[ofResiduals.rowIndices[k]];
    }
    return { objective, gradient, rows, jacobians, residuals: ofResiduals };
  }

  /** As the caller gives it: the upper triangle, or all. Undefined if there is none. */
  hessian(x: Float64Array, multipliers: Multipliers): Csc | undefined {
    if (this.problem.hessian === undefined) return undefined;
    return this.matrix("hessian", this.problem.hessian(x.slice(), multipliers), x.length, x.length);
  }

  private vector(field: string, values: ArrayLike<number>): Float64Array {
    const size = this.sizes.get(field) ?? values.length;
    const taken = takeVector(field, values, size, "as at the first point");
    this.sizes.set(field, size);
    return taken;
  }

  private matrix(field: string, matrix: Matrix | undefined, rows: number, columns: number): Csc {
    if (matrix === undefined && rows > 0) throw invalid(field, `must be a matrix of ${rows} rows`, { value: matrix });
    const asked = matrix ?? { rows, cols: columns, i: [], j: [], v: [] };
    checkFinite(field, asked);
    const first = this.patterns.get(field);
    if (first !== undefined) return { ...first, values: takeValues(field, asked, first, "the first point") };
    const taken = takeMatrix(field, everyEntry(asked, columns), columns);
    if (taken.rows !== rows) throw invalid(`${field}.rows`, `must be ${rows}, a row a function`, { value: taken.rows });
    this.patterns.set(field, taken);
    return taken;
  }
}

function given<Result>(name: string, result: Result): Result {
  if (typeof result !== "object" || result === null) throw invalid(name, "must return an object", { value: result });
  return result;
}

function limits(field: string, given: ArrayLike<number> | undefined, n: number, otherwise: number): Float64Array {
  if (given === undefined) return new Float64Array(n).fill(otherwise);
  if (given.length !== n) throw invalid(field, `must have ${n} entries (variables)`, { value: `${given.length} entries` });
  return Float64Array.from(given);
}

// By row and column: its place among the entries would tell the caller little.
function checkFinite(field: string, matrix: Matrix): void {
  const fault = (index: number, column: number, value: number): Error =>
    invalid(field, `must be finite, in column ${column} too`, { index, value });
  if (Array.isArray(matrix)) {
    for (const [row, entries] of (matrix as ArrayLike<number>[]).entries()) {
      const column = Array.from(entries ?? []).findIndex((value) => !Number.isFinite(value));
      if (column >= 0) throw fault(row, column, entries[column]);
    }
  } else if (typeof matrix === "object" && "columnPointers" in matrix) {
    const k = Array.from(matrix.values ?? []).findIndex((value) => !Number.isFinite(value));
    const column = Array.from(matrix.columnPointers ?? []).findIndex((pointer) => pointer > k) - 1;
    if (k >= 0) throw fault(matrix.rowIndices[k], column, matrix.values[k]);
  } else if (typeof matrix === "object" && "v" in matrix) {
    const k = Array.from(matrix.v ?? []).findIndex((value) => !Number.isFinite(value));
    if (k >= 0) throw fault(matrix.i[k], matrix.j[k], matrix.v[k]);
  }
}

// A dense matrix's zeros belong to its pattern here: they may be others at the next x.
function everyEntry(matrix: Matrix, columns: number): Matrix {
  if (!Array.isArray(matrix)) return matrix;
  const rows = matrix as ArrayLike<number>[];
  if (rows.some((row) => row?.length !== columns)) return matrix; // refused in the words of all matrices
  return {
    rows: rows.length,
    columns,
    columnPointers: Array.from({ length: columns + 1 }, (_, column) => column * rows.length),
    rowIndices: Array.from({ length: columns * rows.length }, (_, k) => k % rows.length),
    values: Array.from({ length: columns * rows.length }, (_, k) => rows[k % rows.length][Math.floor(k / rows.length)]),
  };
}
