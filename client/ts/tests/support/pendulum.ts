import type { NonlinearProblem, RealTimeSettings, Triplets } from "@marble/client";

/**
 * A pendulum with a weak motor u and a stop at −0.2 rad that pushes with f: ω' = ω + h (−sin θ + u + f), θ' = θ + h ω',
 * 0 ≤ f ⊥ θ' + 0.2 ≥ 0, |u| ≤ 0.8. A stage is θ, ω, u, f; the last one has the first two alone.
 */
export const stages = 12;
const [h, stop] = [0.1, 0.2];
const n = 4 * stages + 2;
const weights = Array.from({ length: n }, (_, j) => [1, 0.3, 0.2, 0.05][j % 4] * (j >= 4 * stages ? 3 : 1));

export const shift: NonNullable<RealTimeSettings["shift"]> = {
  variables: [{ first: 0, count: n, by: 4 }],
  equalities: [{ first: 0, count: 2 * stages, by: 2 }],
  pairs: [{ first: 0, count: stages, by: 1 }],
};

const triplets = (rows: number, entries: [number, number, number][]): Triplets => ({
  rows,
  cols: n,
  i: entries.map(([i]) => i),
  j: entries.map(([, j]) => j),
  v: entries.map(([, , v]) => v),
});
const all = Array.from({ length: stages }, (_, k) => k);

/** By residuals, or the same cost as an objective with its Hessian. */
export function pendulum(curvature: "gauss_newton" | "exact"): NonlinearProblem {
  const bySquares = curvature === "gauss_newton";
  return {
    start: new Float64Array(n),
    lower: Array.from({ length: n }, (_, j) => (j % 4 === 2 && j < 4 * stages ? -0.8 : -Infinity)),
    upper: Array.from({ length: n }, (_, j) => (j % 4 === 2 && j < 4 * stages ? 0.8 : Infinity)),
    values: (x) => ({
      objective: bySquares ? 0 : x.reduce((sum, value, j) => sum + 0.5 * (weights[j] * value) ** 2, 0),
      residuals: bySquares ? x.map((value, j) => weights[j] * value) : [],
      equalities: all.flatMap((k) => {
        const [angle, speed, u, f, next, nextSpeed] = x.subarray(4 * k, 4 * k + 6);
        return [next - angle - h * nextSpeed, nextSpeed - speed - h * (u + f - Math.sin(angle))];
      }),
      G: all.map((k) => x[4 * k + 3]),
      H: all.map((k) => x[4 * k + 4] + stop),
    }),
    derivatives: (x) => ({
      gradient: bySquares ? new Float64Array(n) : x.map((value, j) => weights[j] ** 2 * value),
      residuals: bySquares ? triplets(n, weights.map((weight, j) => [j, j, weight])) : undefined,
      equalities: triplets(
        2 * stages,
        all.flatMap((k): [number, number, number][] => [
          [2 * k, 4 * k + 4, 1],
          [2 * k, 4 * k, -1],
          [2 * k, 4 * k + 5, -h],
          [2 * k + 1, 4 * k + 5, 1],
          [2 * k + 1, 4 * k + 1, -1],
          [2 * k + 1, 4 * k + 2, -h],
          [2 * k + 1, 4 * k + 3, -h],
          [2 * k + 1, 4 * k, h * Math.cos(x[4 * k])],
        ]),
      ),
      G: triplets(stages, all.map((k) => [k, 4 * k + 3, 1])),
      H: triplets(stages, all.map((k) => [k, 4 * k + 4, 1])),
    }),
    hessian: bySquares
      ? undefined
      : (x, { equalities }) =>
          triplets(n, [
            ...weights.map((weight, j): [number, number, number] => [j, j, weight ** 2]),
            ...all.map((k): [number, number, number] => [4 * k, 4 * k, -h * equalities[2 * k + 1] * Math.sin(x[4 * k])]),
          ]),
  };
}

/** One stage on, by the laws above: the stop pushes as much as it must. */
export function moveOn([angle, speed]: number[], u: number): number[] {
  const free = speed + h * (u - Math.sin(angle));
  const next = Math.max(free, (-stop - angle) / h);
  return [angle + h * next, next];
}

/** Of a stage of the loop as it went. */
export const cost = ([angle, speed]: number[], u: number): number =>
  angle ** 2 + (weights[1] * speed) ** 2 + (weights[2] * u) ** 2;
