import { invalid } from "../base/errors.js";
import { type Csc, takeMatrix } from "../model/matrix.js";
import type { Functions, Multipliers, Point } from "./functions.js";

/** Where B of the LCQP's ½ dᵀBd comes from: the Hessian, JᵀJ of the residuals, or nowhere. */
export type CurvatureKind = "exact" | "gauss_newton" | "none";

/** B: its upper triangle, in a pattern that is fixed and has the diagonal. */
export class Curvature {
  readonly upper: Csc;
  private readonly kind: CurvatureKind;
  /** Triples: an entry times another, or an entry, −1, is added to a place in B. */
  private readonly terms: Int32Array;

  /** `diagonal` over scale² is added to B's diagonal. */
  constructor(
    private readonly functions: Functions,
    kind: CurvatureKind | undefined,
    private readonly diagonal: number,
    x: Float64Array,
    first: Point,
    multipliers: Multipliers,
  ) {
    const hessian = kind === undefined || kind === "exact" ? functions.hessian(x, multipliers) : undefined;
    const chosen = kind ?? (hessian !== undefined ? "exact" : first.residuals.rows > 0 ? "gauss_newton" : undefined);
    if (chosen === undefined || !["exact", "gauss_newton", "none"].includes(chosen)) {
      const bound = "must be exact, gauss_newton or none: the problem has neither Hessian nor residuals";
      throw invalid("curvature", chosen === undefined ? bound : bound.split(":")[0], { value: chosen });
    }
    if (chosen === "exact" && hessian === undefined)
      throw invalid("hessian", "must be a function: the curvature shall be exact");
    this.kind = chosen;
    const ofResiduals = chosen === "gauss_newton" ? products(first.residuals) : [];
    const entries = hessian !== undefined ? singles(hessian) : ofResiduals;
    const n = x.length;
    const diagonals = Array.from({ length: n }, (_, j) => j);
    const rows = [...entries.map(({ row }) => row), ...diagonals];
    const v = new Float64Array(rows.length);
    const columns = [...entries.map(({ column }) => column), ...diagonals];
    this.upper = takeMatrix("hessian", { rows: n, cols: n, i: rows, j: columns, v }, n);
    this.terms = Int32Array.from(entries.flatMap(({ a, b, row, column }) => [a, b, place(this.upper, row, column)]));
    this.move(x, first, multipliers);
  }

  /** B at a new x. */
  move(x: Float64Array, point: Point, multipliers: Multipliers): void {
    const { values, columnPointers } = this.upper;
    values.fill(0);
    for (let j = 0; j < x.length; ++j) values[columnPointers[j + 1] - 1] = this.diagonal / this.functions.scale[j] ** 2;
    if (this.kind === "none") return;
    const from = this.kind === "exact" ? this.functions.hessian(x, multipliers) : point.residuals;
    const numbers = (from as Csc).values;
    for (let k = 0; k < this.terms.length; k += 3) {
      const [a, b, to] = this.terms.subarray(k, k + 3);
      values[to] += b < 0 ? numbers[a] : numbers[a] * numbers[b];
    }
  }
}

interface Entry {
  a: number;
  b: number;
  row: number;
  column: number;
}

function singles(hessian: Csc): Entry[] {
  return entriesOf(hessian)
    .map(({ row, column }, a) => ({ a, b: -1, row, column }))
    .filter(({ row, column }) => row <= column);
}

// Of the entries of each row, every two.
function products(jacobian: Csc): Entry[] {
  const byRow: { a: number; column: number }[][] = Array.from({ length: jacobian.rows }, () => []);
  entriesOf(jacobian).forEach(({ row, column }, a) => byRow[row].push({ a, column }));
  return byRow.flatMap((entries) =>
    entries.flatMap(({ a, column: row }, first) =>
      entries.slice(first).map(({ a: b, column }) => ({ a, b, row, column })),
    ),
  );
}

function entriesOf(matrix: Csc): { row: number; column: number }[] {
  const entries = [];
  for (let column = 0; column < matrix.columns; ++column)
    for (let k = matrix.columnPointers[column]; k < matrix.columnPointers[column + 1]; ++k)
      entries.push({ row: matrix.rowIndices[k], column });
  return entries;
}

function place(matrix: Csc, row: number, column: number): number {
  return matrix.rowIndices.indexOf(row, matrix.columnPointers[column]);
}
