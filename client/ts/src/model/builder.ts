import { invalid } from "../errors.js";
import type { Triplets } from "./matrix.js";
import type { Problem } from "./problem.js";
import type { Solution } from "./solution.js";

/** A variable's index and its factor. */
export type Term = readonly [index: number, factor: number];

/** A variable by its index, or Σ factor · z[index] + constant. */
export type Expression = number | { terms: readonly Term[]; constant?: number };

// Limits of this size or more count as none.
const infinite = 1e20;

/** Limits; default: none. A limit of 1e20 or more counts as none. */
export interface Bounds {
  lower?: number;
  upper?: number;
}

/** The solution of one pair 0 ≤ left ⊥ right ≥ 0. */
export interface PairReport {
  /** Values of the two sides. */
  left: number;
  right: number;
  /** Their multipliers. */
  leftDual: number;
  rightDual: number;
}

/**
 * A solution by the builder's rows, bounds and pairs. A dual is positive if the lower limit is active, negative if the
 * upper one is, so that Qz + g = Σ row dual · row + Σ bound dual · unit + Σ pair dual · side.
 */
export interface Report {
  z: Float64Array;
  objective: number;
  /** One per row, in their order. */
  rowDuals: Float64Array;
  /** One per variable; 0 without bounds. */
  boundDuals: Float64Array;
  pairs: PairReport[];
}

// The rows of the problem for a two-sided row: an equality, or up to two inequalities.
interface Place {
  equality?: number;
  lower?: number;
  upper?: number;
}

/**
 * Builds a problem from two-sided rows, bounds and pairs of variables.
 *
 * ```ts
 * const builder = new ProblemBuilder(2).linear(0, -1).linear(1, -2);
 * builder.row([[0, 1], [1, 1]], { upper: 3 });
 * builder.pair(0, 1);
 * const problem = builder.build();
 * const { z, rowDuals } = problem.report(await client.solve(problem));
 * ```
 */
export class ProblemBuilder {
  private readonly g: Float64Array;
  private readonly Q = new Rows();
  private readonly A = new Rows();
  private readonly C = new Rows();
  private readonly L = new Rows();
  private readonly R = new Rows();
  private readonly rows: Place[] = [];
  private readonly bounds = new Map<number, Bounds>();
  private c0 = 0;

  /** @param n the number of variables, ≥ 1 */
  constructor(
    private readonly n: number,
    private readonly name = "",
  ) {
    if (!Number.isInteger(n) || n < 1) throw invalid("n", "must be a whole number >= 1", { value: n });
    this.g = new Float64Array(n);
  }

  /** Adds factor · z[i] to the objective. */
  linear(i: number, factor: number): this {
    this.checkTerms("linear", [[i, factor]]);
    this.g[i] += factor;
    return this;
  }

  /** Adds factor · z[i] · z[j] to the objective. */
  quadratic(i: number, j: number, factor: number): this {
    this.checkTerms("quadratic", [
      [i, factor],
      [j, factor],
    ]);
    this.Q.entry(i, j, factor);
    this.Q.entry(j, i, factor);
    return this;
  }

  /** Adds ½ weight · (Σ factor · z[index] + constant)² to the objective. */
  square(weight: number, expression: Expression): this {
    const { terms, constant } = this.affine("square", expression);
    this.checkNumber("square", "weight", weight);
    for (const [i, a] of terms) {
      for (const [j, b] of terms) this.Q.entry(i, j, weight * a * b);
      this.g[i] += weight * constant * a;
    }
    this.c0 += 0.5 * weight * constant * constant;
    return this;
  }

  /** Adds a constant to the objective. */
  constant(value: number): this {
    this.checkNumber("constant", "value", value);
    this.c0 += value;
    return this;
  }

  /** Adds lower ≤ Σ factor · z[index] ≤ upper, an equality if both are equal. Returns the row's index in `rowDuals`. */
  row(terms: readonly Term[], limits: Bounds): number {
    const field = `rows[${this.rows.length}]`;
    this.checkTerms(field, terms);
    this.rows.push(this.place(field, terms, limits));
    return this.rows.length - 1;
  }

  /** Sets lower ≤ z[i] ≤ upper, in place of earlier bounds of z[i]. */
  bound(i: number, limits: Bounds): this {
    this.checkTerms("bounds", [[i, 1]]);
    limitsOf(`bounds[${i}]`, limits);
    this.bounds.set(i, limits);
    return this;
  }

  /** Adds 0 ≤ left ⊥ right ≥ 0. Returns the pair's index in `report().pairs`. */
  pair(left: Expression, right: Expression): number {
    const field = `pairs[${this.L.count}]`;
    const sides = [this.affine(`${field}.left`, left), this.affine(`${field}.right`, right)];
    this.L.add(sides[0].terms, sides[0].constant);
    return this.R.add(sides[1].terms, sides[1].constant);
  }

  /** Returns the current problem. The builder remains usable. */
  build(): BuiltProblem {
    const [A, C] = [this.A.copy(), this.C.copy()];
    const bounds = new Map<number, Place>();
    for (const [i, limits] of this.bounds) bounds.set(i, place(`bounds[${i}]`, [[i, 1]], limits, A, C));
    return new BuiltProblem(
      {
        name: this.name,
        Q: { ...this.Q.matrix(this.n), rows: this.n },
        g: this.g.slice(),
        c0: this.c0,
        A: A.matrix(this.n),
        b: A.constants,
        C: C.matrix(this.n),
        d: C.constants,
        L: this.L.matrix(this.n),
        l: this.L.constants.slice(),
        R: this.R.matrix(this.n),
        r: this.R.constants.slice(),
      },
      this.rows.slice(),
      bounds,
    );
  }

  private place(field: string, terms: readonly Term[], limits: Bounds): Place {
    return place(field, terms, limits, this.A, this.C);
  }

  private affine(field: string, expression: Expression): { terms: readonly Term[]; constant: number } {
    const given = typeof expression === "number" ? { terms: [[expression, 1] as const] } : expression;
    const constant = given.constant ?? 0;
    this.checkTerms(field, given.terms);
    this.checkNumber(field, "constant", constant);
    return { terms: given.terms, constant };
  }

  private checkTerms(field: string, terms: readonly Term[]): void {
    terms.forEach(([i, factor], index) => {
      if (!Number.isInteger(i) || i < 0 || i >= this.n) {
        throw invalid(field, `must be a variable's index in [0, ${this.n})`, { index, value: i });
      }
      if (!Number.isFinite(factor)) throw invalid(field, "must be finite", { index, value: factor });
    });
  }

  private checkNumber(field: string, part: string, value: number): void {
    if (!Number.isFinite(value)) throw invalid(`${field}.${part}`, "must be finite", { value });
  }
}

/** A problem from a builder, which converts solutions back. */
export class BuiltProblem implements Problem {
  declare readonly name: string;
  declare readonly Q: Triplets;
  declare readonly g: Float64Array;
  declare readonly c0: number;
  declare readonly A: Triplets;
  declare readonly b: number[];
  declare readonly C: Triplets;
  declare readonly d: number[];
  declare readonly L: Triplets;
  declare readonly l: number[];
  declare readonly R: Triplets;
  declare readonly r: number[];
  readonly #rows: Place[];
  readonly #bounds: Map<number, Place>;

  /** @internal */
  constructor(problem: Problem, rows: Place[], bounds: Map<number, Place>) {
    Object.assign(this, problem);
    this.#rows = rows;
    this.#bounds = bounds;
  }

  /** Converts a solution to the builder's rows, bounds and pairs. */
  report(solution: Solution): Report {
    const dual = ({ equality, lower, upper }: Place): number =>
      (equality === undefined ? 0 : -solution.equalityMultipliers[equality]) +
      (lower === undefined ? 0 : solution.inequalityMultipliers[lower]) -
      (upper === undefined ? 0 : solution.inequalityMultipliers[upper]);
    const boundDuals = new Float64Array(this.g.length);
    for (const [i, place] of this.#bounds) boundDuals[i] = dual(place);
    const left = product(this.L, this.l, solution.z);
    const right = product(this.R, this.r, solution.z);
    return {
      z: solution.z,
      objective: solution.objective,
      rowDuals: Float64Array.from(this.#rows, dual),
      boundDuals,
      pairs: left.map((value, k) => ({
        left: value,
        right: right[k],
        leftDual: solution.complementarityMultipliersL[k],
        rightDual: solution.complementarityMultipliersR[k],
      })),
    };
  }
}

/** Rows Σ factor · z[index] + constant as triplets. */
class Rows {
  readonly i: number[] = [];
  readonly j: number[] = [];
  readonly v: number[] = [];
  readonly constants: number[] = [];

  get count(): number {
    return this.constants.length;
  }

  add(terms: readonly Term[], constant: number, sign = 1): number {
    for (const [index, factor] of terms) this.entry(this.count, index, sign * factor);
    return this.constants.push(constant) - 1;
  }

  entry(row: number, column: number, value: number): void {
    this.i.push(row);
    this.j.push(column);
    this.v.push(value);
  }

  matrix(columns: number): Triplets {
    return { rows: this.count, cols: columns, i: this.i.slice(), j: this.j.slice(), v: this.v.slice() };
  }

  copy(): Rows {
    const copy = new Rows();
    for (const [k, row] of this.i.entries()) copy.entry(row, this.j[k], this.v[k]);
    for (const constant of this.constants) copy.constants.push(constant);
    return copy;
  }
}

function place(field: string, terms: readonly Term[], limits: Bounds, A: Rows, C: Rows): Place {
  const { lower, upper } = limitsOf(field, limits);
  if (lower === upper) return { equality: A.add(terms, -lower) };
  const result: Place = {};
  if (lower > -infinite) result.lower = C.add(terms, 0 - lower);
  if (upper < infinite) result.upper = C.add(terms, upper, -1);
  return result;
}

function limitsOf(field: string, { lower = -Infinity, upper = Infinity }: Bounds): { lower: number; upper: number } {
  if (!(lower < infinite)) {
    throw invalid(`${field}.lower`, "must be below 1e20; -Infinity is no limit", { value: lower });
  }
  if (!(upper > -infinite)) {
    throw invalid(`${field}.upper`, "must be above -1e20; Infinity is no limit", { value: upper });
  }
  if (lower > upper) throw invalid(`${field}.lower`, `must be at most the upper limit ${upper}`, { value: lower });
  return { lower, upper };
}

function product(matrix: Triplets, constants: number[], z: Float64Array): number[] {
  const result = constants.slice();
  for (let k = 0; k < matrix.v.length; ++k) result[matrix.i[k]] += matrix.v[k] * z[matrix.j[k]];
  return result;
}
