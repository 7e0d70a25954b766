// Model predictive control over a session: plan, follow the first step, and plan again with a warm start.
//
//   marble example hopper > hopper.json && node build/examples/mpc.js hopper.json 50
import { readFileSync } from "node:fs";

import { connect, shiftByStage } from "@marble/client";

import { type Hopper, advance, at, stepsOf } from "./hopper-model.js";

const nominal = JSON.parse(readFileSync(process.argv[2], "utf8")) as Hopper;
const steps = Number(process.argv[3] ?? 50);
const shift = shiftByStage(nominal, stepsOf(nominal));

const client = connect();
{
  await using session = await client.session(nominal);
  let problem = nominal;
  let plan = await session.update();
  for (let step = 0; step <= steps; ++step) {
    const [x, ms] = [plan.z[at.bodyX], 1000 * plan.times.solveS];
    console.log(
      `${String(step).padStart(4)} ${plan.status.padEnd(16)} ${String(plan.factorizations).padStart(5)} factorizations ` +
        `${ms.toFixed(2).padStart(8)} ms  x = ${x.toFixed(3)} m  objective ${plan.objective.toExponential(7)}`,
    );
    if (step === steps) break;
    problem = advance(nominal, problem, plan.z);
    const { b, g, c0 } = problem;
    plan = await session.update({ b, g, c0 }, { shift });
  }
}
client.close();
