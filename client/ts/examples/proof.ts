// Solves a problem file to proved optimality and prints how incumbent and bound converge.
//
//   marble example rocket > rocket.json && node build/examples/proof.js rocket.json 10
import { readFileSync } from "node:fs";

import { type Problem, connect } from "@marble/client";

const problem = JSON.parse(readFileSync(process.argv[2], "utf8")) as Problem;
const options = { globalSearch: true, timeLimitS: Number(process.argv[3] ?? 10) };

const client = connect();
for await (const event of client.solveStream(problem, { options, progressIntervalS: 0.2 })) {
  if (event.type === "progress") {
    const row = event.rows.at(-1);
    if (row !== undefined && row.nodes > 0) console.log(`${row.nodes} nodes: ${row.incumbent} to ${row.bound}`);
  }
  if (event.type === "result") {
    const { status, objective, proved, gap, bound } = event.solution;
    console.log(`${status}: ${objective}, ${proved ? "proved optimal" : `not proved, bound ${bound}, gap ${gap}`}`);
  }
}
client.close();
