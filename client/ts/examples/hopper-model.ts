// The variables of the hopper of `marble example hopper`: a body and a foot, joined by a leg, cross stairs.
import type { Problem } from "@marble/client";

/** The hopper's problem file; a control step changes these vectors. */
export interface Hopper extends Problem {
  g: number[];
  b: number[];
  c0: number;
}

/** Variables and equalities of one step. */
export const variables = 26;
const equalities = 13;

/** Indices of one step's variables. */
export const at = { bodyX: 0, bodyZ: 1, footX: 2, footZ: 3, forceX: 8, forceZ: 9, normalForce: 12 } as const;

const trackingWeight = 20;
const forceRateWeight = 0.01;

export const stepsOf = (problem: Hopper): number => problem.b.length / equalities;

/**
 * The problem of the next control step, after the plan's first step: it has a new initial state, last force and point
 * to track. `nominal` is the original problem, which starts at rest.
 */
export function advance(nominal: Hopper, now: Hopper, z: Float64Array): Hopper {
  const [b, g] = [now.b.slice(), now.g.slice()];
  for (let i = 0; i < 4; ++i) {
    b[i] = -z[i]; // positions
    b[4 + i] = nominal.b[4 + i] - z[4 + i]; // velocities, gravity stays
  }
  const perStep = nominal.g[variables] - nominal.g[0];
  for (let k = 0; k < g.length; k += variables) g[k] += perStep;
  g[at.forceX] = -forceRateWeight * z[at.forceX];
  g[at.forceZ] = -forceRateWeight * z[at.forceZ];
  return { ...now, b, g, c0: constant(g) };
}

// The constant of the squares ½ w (x − r)², whose linear terms −w r are in g.
function constant(g: number[]): number {
  let sum = (g[at.forceX] ** 2 + g[at.forceZ] ** 2) / (2 * forceRateWeight);
  for (let k = 0; k < g.length; k += variables) sum += g[k] ** 2 / (2 * trackingWeight);
  return sum;
}
