// Solves a problem file and prints every iteration; Ctrl-C cancels the solve.
//
//   marble example rocket > rocket.json && node build/examples/progress.js rocket.json
import { readFileSync } from "node:fs";

import { CancelledError, type Problem, connect } from "@marble/client";

const problem = JSON.parse(readFileSync(process.argv[2], "utf8")) as Problem;
const interrupt = new AbortController();
process.once("SIGINT", () => interrupt.abort());

const client = connect();
try {
  for await (const event of client.solveStream(problem, { signal: interrupt.signal })) {
    if (event.type === "accepted") console.log(`job ${event.jobId}, ${event.queuePosition} before it`);
    if (event.type === "progress") {
      for (const { iteration, objective, kktResidual, kappa } of event.rows) {
        const numbers = [objective, kktResidual, kappa].map((value) => value.toExponential(3).padStart(11));
        console.log(`${String(iteration).padStart(5)} ${numbers.join(" ")}`);
      }
    }
    if (event.type === "result") console.log(String(event.solution));
  }
} catch (error) {
  if (!(error instanceof CancelledError)) throw error;
  console.log("cancelled");
} finally {
  client.close();
}
