// Where things are in the hopper that `marble example hopper` makes: a body and a foot joined by a leg, that cross stairs.
import type { Problem } from "@marble/client";

/** The hopper's file; the vectors are what a tick of a closed loop changes. */
export interface Hopper extends Problem {
  g: number[];
  b: number[];
  c0: number;
}

/** Variables and equalities of one step. */
export const variables = 26;
const equalities = 13;

/** Places of one step's variables. */
export const at = { bodyX: 0, bodyZ: 1, footX: 2, footZ: 3, forceX: 8, forceZ: 9, normalForce: 12 } as const;

const trackingWeight = 20;
const forceRateWeight = 0.01;

export const stepsOf = (problem: Hopper): number => problem.b.length / equalities;

/**
 * What changes once the plan's first step has been followed: the state that the horizon begins with, the last force, and the
 * point to track. `nominal` is the problem as it was made, from rest.
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

// Of the squares ½ w (x − r)², which g knows as −w r.
function constant(g: number[]): number {
  let sum = (g[at.forceX] ** 2 + g[at.forceZ] ** 2) / (2 * forceRateWeight);
  for (let k = 0; k < g.length; k += variables) sum += g[k] ** 2 / (2 * trackingWeight);
  return sum;
}
