import type { Problem, Solution, Triplets } from "@marble/client";

import { marble } from "./server.js";

/** A problem file's content: every matrix as triplets. */
export interface FileProblem extends Problem {
  Q: Triplets;
  A: Triplets;
  C: Triplets;
  L: Triplets;
  R: Triplets;
  g: number[];
  b: number[];
  d: number[];
  l: number[];
  r: number[];
}

/** min (z0 − 1)² + (z1 − 1)² + (z2 − 3)²  s.t.  0 ≤ z0 ⊥ z1 ≥ 0,  z2 ≤ 2: objective 2, z2 = 2, its bound's ν = 2. */
export const corner: Problem = {
  name: "corner",
  Q: [
    [2, 0, 0],
    [0, 2, 0],
    [0, 0, 2],
  ],
  g: [-2, -2, -6],
  c0: 11,
  C: [[0, 0, -1]],
  d: [2],
  L: [[1, 0, 0]],
  l: [0],
  R: [[0, 1, 0]],
  r: [0],
};

/** As `marble example` makes it. */
export function example(name: string, ...words: string[]): FileProblem {
  return JSON.parse(marble("example", name, ...words)) as FileProblem;
}

/** Takes seconds: enough to be seen while it runs. */
export function long(): Problem {
  return example("gates", "--steps", "120");
}

/** Options for which a solve goes on as long as it is let. */
export const endless = { starts: 1000, localSearchBudget: 1_000_000 } as const;

/** The largest violation of a point, from the problem's own numbers. */
export function violation(problem: FileProblem, z: ArrayLike<number>): number {
  const equality = product(problem.A, problem.b, z).map(Math.abs);
  const inequality = product(problem.C, problem.d, z).map((value) => -value);
  const right = product(problem.R, problem.r, z);
  const pairs = product(problem.L, problem.l, z).map((s, k) => Math.abs(Math.min(s, right[k])));
  return Math.max(0, ...equality, ...inequality, ...pairs);
}

/** The largest entry of Qz + g + Aᵀy − Cᵀν − Lᵀξ − Rᵀη. */
export function stationarity(problem: FileProblem, s: Solution): number {
  const sum = product(problem.Q, problem.g, s.z);
  addTransposed(sum, problem.A, s.equalityMultipliers, 1);
  addTransposed(sum, problem.C, s.inequalityMultipliers, -1);
  addTransposed(sum, problem.L, s.leftMultipliers, -1);
  addTransposed(sum, problem.R, s.rightMultipliers, -1);
  return Math.max(...sum.map(Math.abs));
}

function product(m: Triplets, offset: number[], z: ArrayLike<number>): number[] {
  const result = offset.slice();
  for (let k = 0; k < m.v.length; ++k) result[m.i[k]] += m.v[k] * z[m.j[k]];
  return result;
}

function addTransposed(sum: number[], m: Triplets, multipliers: ArrayLike<number>, sign: number): void {
  for (let k = 0; k < m.v.length; ++k) sum[m.j[k]] += sign * m.v[k] * multipliers[m.i[k]];
}
