import type { Problem, Solution, SolveOptions, Triplets } from "@marble/client";

import { marble } from "./server.js";

/** The content of a problem file: every matrix as triplets. */
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

/** A problem of `marble example`. */
export function example(name: string, ...words: string[]): FileProblem {
  return JSON.parse(marble("example", name, ...words)) as FileProblem;
}

/** A chain of states x, controls u and forces f: x' = x + u + f/2, 0 ≤ f ⊥ x + ½ ≥ 0, |u| ≤ 1. */
export function chain(steps: number): FileProblem {
  const n = 3 * steps;
  const matrix = (rows: number): Triplets & Record<"i" | "j" | "v", number[]> => ({
    rows,
    cols: n,
    i: [],
    j: [],
    v: [],
  });
  const [Q, A, C, L, R] = [n, steps, 2 * steps, steps, steps].map(matrix);
  const put = (m: typeof Q, i: number, j: number, v: number): void => void [m.i.push(i), m.j.push(j), m.v.push(v)];
  const g = new Array<number>(n).fill(0);
  for (let k = 0; k < n; ++k) put(Q, k, k, 1);
  for (let k = 0; k < steps; ++k) {
    const [x, u, f] = [3 * k, 3 * k + 1, 3 * k + 2];
    g[x] = Math.sin(0.1 * k);
    if (k > 0) put(A, k, x - 3, -1);
    put(A, k, x, 1);
    put(A, k, u, -1);
    put(A, k, f, -0.5);
    put(C, 2 * k, u, 1);
    put(C, 2 * k + 1, u, -1);
    put(L, k, f, 1);
    put(R, k, x, 1);
  }
  const fill = (size: number, value: number): number[] => new Array<number>(size).fill(value);
  return {
    name: "chain",
    Q,
    g,
    A,
    b: fill(steps, 0),
    C,
    d: fill(2 * steps, 1),
    L,
    l: fill(steps, 0),
    R,
    r: fill(steps, 0.5),
  };
}

/**
 * Options that make the solve of a chain take a million iterations: kappa = 1 and tiny steps of rho, each one full
 * Newton step along a smooth path on any machine.
 */
export const endless: SolveOptions = {
  path: "paper",
  polish: false,
  maxIterations: 1_000_000,
  kappaInitial: 1,
  rhoInitial: 1,
  rhoFactor: 1.00001,
  rhoMax: 1e12,
  equalityTolerance: 1e-14,
  inequalityTolerance: 1e-14,
  complementarityTolerance: 1e-14,
  stationarityTolerance: 1e-14,
};

/** A problem for `endless`. */
export const long = chain(2000);

/** The largest violation of a point, computed from the problem's data. */
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
  addTransposed(sum, problem.L, s.complementarityMultipliersL, -1);
  addTransposed(sum, problem.R, s.complementarityMultipliersR, -1);
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
