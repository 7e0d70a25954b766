// Client-side costs of a problem of 1 MB: checking and packing, encoding, and decoding a solution of that size.
import { SolveRequest, SolveResponse } from "../dist/generated/marble/v1/service.js";
import { packDoubles } from "../dist/packed.js";
import { Solution } from "../dist/model/solution.js";
import { solveRequest } from "../dist/calls/solve.js";

const [n, perColumn] = [2000, 40];
const entries = n * perColumn;
const A = {
  rows: n,
  columns: n,
  columnPointers: Int32Array.from({ length: n + 1 }, (_, k) => perColumn * k),
  rowIndices: Int32Array.from({ length: entries }, (_, k) => Math.floor((n / perColumn) * (k % perColumn))),
  values: Float64Array.from({ length: entries }, (_, k) => Math.sin(k)),
};
const problem = { g: Float64Array.from({ length: n }, (_, k) => Math.cos(k)), A };
const request = solveRequest(problem, {});
const bytes = SolveRequest.encode(request).finish();
const solution = { z: packDoubles(Float64Array.from({ length: 131_072 }, (_, k) => 1 / (k + 1))) };
const answer = Buffer.from(SolveResponse.encode(SolveResponse.fromPartial({ solution })).finish());

function median(work) {
  const times = [];
  for (let k = 0; k < 100; ++k) {
    const begin = performance.now();
    work();
    if (k >= 20) times.push(performance.now() - begin);
  }
  return times.sort((a, b) => a - b)[times.length >> 1].toFixed(2);
}

console.log(`problem: ${(bytes.length / 1e6).toFixed(2)} MB, answer: ${(answer.length / 1e6).toFixed(2)} MB, medians`);
console.log(`check and pack ${median(() => solveRequest(problem, {}))} ms`);
console.log(`encode ${median(() => SolveRequest.encode(request).finish())} ms`);
console.log(`decode ${median(() => new Solution("", SolveResponse.decode(answer).solution))} ms`);
