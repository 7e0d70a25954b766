import type { Csc } from "../model/matrix.js";
import type { Problem, ProblemUpdate } from "../model/problem.js";
import type { Solution } from "../model/solution.js";
import { type Functions, type Multipliers, type Point, type RowPart, rowParts } from "./functions.js";

/** What a row that lacks something costs, for each row; of a pair one for both sides. */
export type Weights = Record<"equalities" | "inequalities" | "pairs", Float64Array>;

/** A step d and what comes with it. */
export interface Step {
  d: Float64Array;
  /** max |d_j| / scale_j. */
  size: number;
  multipliers: Multipliers;
}

type Column = [row: number, value: number][];
type Letter = "Q" | "A" | "C" | "L" | "R";

interface Part {
  matrix: Csc;
  /** Of the entries that change, in `matrix`. */
  places: Int32Array;
}

const letters = { equalities: "A", inequalities: "C", G: "L", H: "R" } as const;
const offsets = { equalities: "b", inequalities: "d", G: "l", H: "r" } as const;
const atBound = 1e-12; // of a step: what is nearer to a bound is there

/**
 * The LCQP of a step d from x. A has a row d_j for each variable that is measured, after the problem's; C the rows
 * −low ≤ d ≤ up after the problem's. The elastic one has more variables, each at least 0: what the rows lack.
 */
export class Lcqp {
  readonly b: Float64Array;
  private readonly parts: Partial<Record<Letter, Part>> = {};
  private readonly g: Float64Array;
  private readonly low: Float64Array;
  private readonly up: Float64Array;
  private readonly slacks: { part: RowPart; row: number }[] = [];
  private point: Point;

  constructor(
    private readonly functions: Functions,
    private readonly measured: readonly number[],
    private readonly radius: number,
    first: Point,
    upper: Csc,
    elastic: boolean,
  ) {
    const n = functions.start.length;
    this.point = first;
    const count = (part: RowPart): number => first.rows[part].length + (part === "equalities" ? measured.length : 0);
    const more: Record<RowPart, Column[]> = { equalities: [], inequalities: [], G: [], H: [] };
    if (elastic) {
      const inequalities = count("inequalities") + 2 * n;
      for (const part of rowParts) {
        for (const sign of part === "inequalities" ? [1] : [1, -1]) {
          for (let row = 0; row < count(part); ++row) {
            for (const other of rowParts) more[other].push(other === part ? [[row, sign]] : []);
            more.inequalities.at(-1)?.push([inequalities + this.slacks.length, 1]);
            this.slacks.push({ part, row });
          }
        }
      }
    }
    const columns = n + this.slacks.length;
    const rows = first.rows.inequalities.length;
    const below: Partial<Record<RowPart, (j: number) => Column>> = {
      equalities: (j) => (measured.includes(j) ? [[first.rows.equalities.length + measured.indexOf(j), 1]] : []),
      inequalities: (j) => [
        [rows + j, 1],
        [rows + n + j, -1],
      ],
    };
    for (const part of rowParts) {
      const height = count(part) + (part === "inequalities" ? 2 * n + this.slacks.length : 0);
      if (height === 0) continue;
      this.parts[letters[part]] = assembled(first.jacobians[part], height, below[part], more[part]);
    }
    this.parts.Q = assembled(upper, columns, undefined, new Array<Column>(this.slacks.length).fill([]));
    this.g = new Float64Array(columns);
    this.b = new Float64Array(count("equalities"));
    [this.low, this.up] = [new Float64Array(n), new Float64Array(n)];
  }

  /** At a point x. `b` may be changed afterwards. */
  set(x: Float64Array, point: Point, upper: Csc): void {
    this.point = point;
    this.g.set(point.gradient);
    this.b.set(point.rows.equalities);
    this.measured.forEach((j, k) => (this.b[point.rows.equalities.length + k] = x[j]));
    const { lower, upper: above, scale } = this.functions;
    for (let j = 0; j < x.length; ++j) {
      const fixed = this.measured.includes(j);
      this.low[j] = Math.min(this.radius * scale[j], fixed ? Infinity : x[j] - lower[j]);
      this.up[j] = Math.min(this.radius * scale[j], fixed ? Infinity : above[j] - x[j]);
    }
    const put = (letter: Letter, values: Float64Array): void => {
      const part = this.parts[letter];
      if (part !== undefined) values.forEach((value, k) => (part.matrix.values[part.places[k]] = value));
    };
    put("Q", upper.values);
    for (const part of rowParts) put(letters[part], point.jacobians[part].values);
  }

  setWeights(weights: Weights): void {
    const n = this.functions.start.length;
    this.slacks.forEach(({ part, row }, k) => {
      this.g[n + k] = weights[part === "G" || part === "H" ? "pairs" : part][row];
    });
  }

  problem(): Problem {
    const matrices = Object.entries(this.parts).map(([letter, part]) => [letter, part.matrix]);
    return { ...(Object.fromEntries(matrices) as Problem), hessianForm: "upper_triangle", ...this.vectors() };
  }

  /** All numbers. */
  update(): ProblemUpdate {
    const values = Object.entries(this.parts).map(([letter, part]) => [letter, part.matrix.values]);
    return { ...(Object.fromEntries(values) as ProblemUpdate), ...this.vectors() };
  }

  /** The solver's rounding must not lead out of the bounds, nor to just before them. */
  read(solution: Solution): Step {
    const { scale } = this.functions;
    const n = scale.length;
    const [rows, nu] = [this.point.rows, solution.inequalityMultipliers];
    const [d, bounds] = [solution.z.slice(0, n), new Float64Array(n)];
    let size = 0;
    for (let j = 0; j < n; ++j) {
      const [low, up, row] = [this.low[j], this.up[j], rows.inequalities.length + j];
      d[j] = Math.min(Math.max(d[j], -low), up);
      if (d[j] + low <= atBound * low) d[j] = -low;
      if (up - d[j] <= atBound * up) d[j] = up;
      size = Math.max(size, Math.abs(d[j]) / scale[j]);
      bounds[j] = (low < this.radius * scale[j] ? nu[row] : 0) - (up < this.radius * scale[j] ? nu[row + n] : 0);
    }
    const multipliers = {
      equalities: solution.equalityMultipliers,
      inequalities: nu.slice(0, rows.inequalities.length),
      G: solution.leftMultipliers,
      H: solution.rightMultipliers,
      bounds,
    };
    return { d, size, multipliers };
  }

  /** The largest of the problem's rows and the measured ones after a step. */
  violation(d: Float64Array): number {
    const [equalities, inequalities, G, H] = rowParts.map((part) => this.rowsAfter(part, d));
    const worst = (numbers: Float64Array): number => numbers.reduce((most, value) => Math.max(most, value), 0);
    return Math.max(
      worst(equalities.map(Math.abs)),
      worst(inequalities.map((value) => -value)),
      worst(G.map((value, k) => Math.abs(Math.min(value, H[k])))),
    );
  }

  private rowsAfter(part: RowPart, d: Float64Array): Float64Array {
    const sum = part === "equalities" ? this.b.slice() : this.point.rows[part].slice();
    const matrix = this.parts[letters[part]]?.matrix;
    if (matrix === undefined) return sum;
    for (let j = 0; j < d.length; ++j) {
      for (let k = matrix.columnPointers[j]; k < matrix.columnPointers[j + 1]; ++k)
        if (matrix.rowIndices[k] < sum.length) sum[matrix.rowIndices[k]] += matrix.values[k] * d[j];
    }
    return sum;
  }

  private vectors(): Pick<Problem, "c0" | "b" | "d" | "l" | "r"> & { g: Float64Array } {
    const made = { g: this.g, c0: this.point.objective, b: this.b } as ReturnType<Lcqp["vectors"]>;
    for (const part of ["G", "H"] as const) made[offsets[part]] = this.point.rows[part];
    made.d = [...this.point.rows.inequalities, ...this.low, ...this.up, ...this.slacks.map(() => 0)];
    return made;
  }
}

function assembled(own: Csc, rows: number, below: ((j: number) => Column) | undefined, more: Column[]): Part {
  const [columnPointers, rowIndices, values, places]: number[][] = [[0], [], [], []];
  const put = (column: Column): void => {
    for (const [row, value] of column) {
      rowIndices.push(row);
      values.push(value);
    }
  };
  for (let j = 0; j < own.columns; ++j) {
    for (let k = own.columnPointers[j]; k < own.columnPointers[j + 1]; ++k) {
      places.push(values.length);
      put([[own.rowIndices[k], own.values[k]]]);
    }
    put(below?.(j) ?? []);
    columnPointers.push(values.length);
  }
  for (const column of more) {
    put(column);
    columnPointers.push(values.length);
  }
  const matrix = {
    rows,
    columns: own.columns + more.length,
    columnPointers: Int32Array.from(columnPointers),
    rowIndices: Int32Array.from(rowIndices),
    values: Float64Array.from(values),
  };
  return { matrix, places: Int32Array.from(places) };
}
