import assert from "node:assert/strict";
import { readFileSync, writeFileSync } from "node:fs";
import { after, before } from "node:test";
import { inspect } from "node:util";

import { CancelledError, type Client, connect, DeadlineError, type Progress, type SolveEvent } from "@marble/client";

import { Solution as Message } from "../src/generated/marble/v1/solution.js";
import { Solution } from "../src/model/solution.js";
import { kindOf, kindText, type SolutionFacts, whatToTry } from "../src/shared/solution-kind.js";
import { chain, corner, endless, example, long, stationarity, violation } from "./support/problems.js";
import { eventually, marble, Server } from "./support/server.js";
import { test } from "./support/test.js";

let server: Server;
let client: Client;

before(async () => {
  server = await Server.start(["--workers", "1"]);
  client = connect(server.address);
});

after(async () => {
  client.close();
  await server[Symbol.asyncDispose]();
});

test("a small problem is solved to its known solution", async () => {
  const solution = await client.solve(corner);
  assert.equal(solution.status, "solved");
  assert.ok(solution.solved);
  assert.ok(Math.abs(solution.objective - 2) < 1e-9);
  assert.ok(Math.abs(solution.z[2] - 2) < 1e-9);
  assert.ok(Math.abs(solution.inequalityMultipliers[0] - 2) < 1e-6);
  assert.ok(solution.z instanceof Float64Array);
  assert.match(solution.jobId, /\S/);
  assert.equal(solution.kind, "proved_optimal");
  assert.equal(solution.nodes, 1);
  const local = await client.solve(corner, { options: { maxSmallProblemNodes: 0 } });
  assert.equal(local.kind, "local_minimum");
  assert.equal(local.kindText, "local minimum; no bound is known");
  assert.match(local.whatToTry, /^num_starts=8 searches 8 times/);
});

test("dense rows, triplets and compressed columns are the same problem", async () => {
  const dense = await client.solve(corner);
  const triplets = await client.solve({
    ...corner,
    Q: { rows: 3, cols: 3, i: [2, 0, 1, 0], j: [2, 0, 1, 0], v: [2, 0.5, 2, 1.5] },
    L: { rows: 1, cols: 3, i: [0], j: [0], v: [1] },
  });
  const columns = await client.solve({
    ...corner,
    Q: {
      rows: 3,
      columns: 3,
      columnPointers: Int32Array.of(0, 1, 2, 3),
      rowIndices: Int32Array.of(0, 1, 2),
      values: Float64Array.of(2, 2, 2),
    },
    hessianForm: "upper_triangle",
  });
  assert.deepEqual(triplets.z, dense.z);
  assert.deepEqual(columns.z, dense.z);
});

for (const name of ["hopper", "rocket"]) {
  test(`the ${name}'s z has the bits that marble solve prints`, async () => {
    const problem = example(name, "--seed", "3");
    const { z, status, objective } = await client.solve(problem);
    writeFileSync(server.file(`${name}.json`), JSON.stringify(problem));
    const printed = JSON.parse(
      marble("solve", "--quiet", "--output", "json", "--server", server.address, server.file(`${name}.json`)),
    ) as { z: number[]; status: string; objective: number };
    assert.equal(status, printed.status);
    assert.equal(objective, printed.objective);
    assert.deepEqual(z, Float64Array.from(printed.z));
  });

  test(`the ${name}'s solution holds against the problem's own numbers`, async () => {
    const problem = example(name);
    const solution = await client.solve(problem);
    assert.ok(solution.solved);
    assert.ok(violation(problem, solution.z) < 1e-6);
    const largest = Math.max(...solution.equalityMultipliers.map(Math.abs), 1);
    assert.ok(stationarity(problem, solution) < 1e-6 * largest);
    assert.ok(solution.inequalityMultipliers.every((nu) => nu >= -1e-9));
  });
}

test("a solve that ends unsolved returns its best iterate", async () => {
  const solution = await client.solve(example("hopper"), { options: { maxIterations: 3 } });
  assert.equal(solution.status, "iteration_limit");
  assert.equal(solution.solved, false);
  assert.match(solution.detail, /3/);
  assert.equal(solution.z.length, example("hopper").g.length);
  assert.equal(solution.options.maxIterations, 3);
});

test("an infeasible problem returns its certificate", async () => {
  const solution = await client.solve({ g: [0], C: [[1], [-1]], d: [-2, 1] });
  assert.equal(solution.status, "infeasible");
  assert.equal(solution.certificate.length, 2);
  assert.equal(solution.conflict, undefined);
});

const explain = { options: { explain: true } };

test("option explain names the rows that conflict and leaves out the others", async () => {
  // z0 ≥ 2 and z0 ≤ 1, between two feasible rows.
  const rows = { C: [[0, 1], [1, 0], [0, -1], [-1, 0]], d: [3, -2, 4, 1] };
  const { status, conflict, factorizations } = await client.solve({ g: [0, 0], ...rows }, explain);
  assert.equal(status, "infeasible");
  assert.ok(conflict !== undefined);
  assert.deepEqual([...conflict.inequalities], [1, 3]);
  for (const part of ["equalities", "leftSides", "rightSides", "complementarities"] as const) {
    assert.equal(conflict[part].length, 0);
  }
  assert.equal(conflict.minimal, true);
  assert.match(conflict.detail, /\S/);
  assert.ok(conflict.linearPrograms > 0);
  assert.ok(conflict.factorizations <= factorizations);
});

test("a conflict contains the pairs that make the problem infeasible", async () => {
  // Pair 1 requires z1 z2 = 0, the equalities z1 = z2 = 1; pair 0 is feasible.
  const pairs = { L: [[1, 0, 0], [0, 1, 0]], l: [0, 0], R: [[1, 0, 0], [0, 0, 1]], r: [0, 0] };
  const rows = { A: [[0, 1, 0], [0, 0, 1]], b: [-1, -1] };
  const { conflict } = await client.solve({ g: [0, 0, 0], ...rows, ...pairs }, explain);
  assert.ok(conflict !== undefined);
  assert.deepEqual([...conflict.equalities], [0, 1]);
  assert.deepEqual([...conflict.complementarities], [1]);
  assert.deepEqual([conflict.inequalities.length, conflict.leftSides.length, conflict.rightSides.length], [0, 0, 0]);
  assert.equal(conflict.minimal, true);
});

test("without proved infeasibility option explain returns no conflict", async () => {
  const solution = await client.solve(corner, explain);
  assert.equal(solution.status, "solved");
  assert.equal(solution.conflict, undefined);
});

test("progress is called for every iteration, in order", async () => {
  const rows: Progress[] = [];
  const problem = example("rocket");
  const solution = await client.solve(problem, { onProgress: (row) => rows.push(row), iterateEvery: 1 });
  assert.ok(rows.length > 2);
  assert.ok(rows.every((row, k) => k === 0 || row.iteration >= rows[k - 1].iteration));
  assert.ok(rows.some((row) => row.z?.length === problem.g.length));
  assert.deepEqual(solution.z, (await client.solve(problem)).z);
});

test("an error thrown by onProgress cancels the call and reaches the caller", async () => {
  const thrown = new Error("enough");
  const solving = client.solve(long, {
    options: endless,
    onProgress: () => {
      throw thrown;
    },
  });
  await assert.rejects(solving, thrown);
  await eventually(async () => (await client.info()).counters.running === 0);
});

test("a stream yields accepted, started, progress and result, in this order", async () => {
  const events: SolveEvent[] = [];
  for await (const event of client.solveStream(corner)) events.push(event);
  const types = events.map((event) => event.type).filter((type, k, all) => type !== all[k - 1]);
  assert.deepEqual(types, ["accepted", "started", "progress", "result"]);
  const last = events.at(-1);
  assert.ok(last?.type === "result" && last.solution.solved);
});

test("leaving a stream's loop frees the worker", async () => {
  for await (const event of client.solveStream(long, { options: endless })) if (event.type === "progress") break;
  await eventually(async () => (await client.info()).counters.running === 0);
  assert.ok((await client.solve(corner)).solved);
});

test("an abort signal rejects with CancelledError and frees the worker", async () => {
  const controller = new AbortController();
  const solving = client.solve(long, {
    options: endless,
    signal: controller.signal,
    onProgress: () => controller.abort("seen enough"),
  });
  await assert.rejects(solving, (error) => error instanceof CancelledError && error.cause === "seen enough");
  await eventually(async () => (await client.info()).counters.running === 0);
});

test("with an aborted signal nothing is sent", async () => {
  const { counters } = await client.info();
  await assert.rejects(client.solve(corner, { signal: AbortSignal.abort() }), CancelledError);
  await assert.rejects(async () => {
    for await (const event of client.solveStream(corner, { signal: AbortSignal.abort() })) assert.fail(event.type);
  }, CancelledError);
  assert.equal((await client.info()).counters.acceptedTotal, counters.acceptedTotal);
});

test("a deadline ends the call with DeadlineError and frees the worker", async () => {
  await assert.rejects(client.solve(long, { options: endless, deadlineMs: 200 }), DeadlineError);
  await eventually(async () => (await client.info()).counters.running === 0);
});

test("the client's deadline applies to calls without one", async () => {
  using impatient = connect(server.address, { deadlineMs: 200 });
  await assert.rejects(impatient.solve(long, { options: endless }), DeadlineError);
  const solution = await impatient.solve(long, { options: { ...endless, timeLimitS: 0.4 }, deadlineMs: 60_000 });
  assert.equal(solution.status, "time_limit");
});

test("arrays may change after the call", async () => {
  const problem = chain(40);
  const expected = await client.solve(problem);
  const solving = client.solve(problem);
  problem.g.fill(NaN);
  assert.deepEqual((await solving).z, expected.z);
});

test("a solve starts from the initial point, or from the problem's x0 without one", async () => {
  const options = { maxIterations: 0 };
  const start = [0.25, 0, 1];
  const given = await client.solve(corner, { options, initialPoint: start });
  const own = await client.solve({ ...corner, x0: start }, { options });
  assert.deepEqual(own.z, given.z);
  assert.notDeepEqual(given.z, (await client.solve(corner, { options })).z);
});

test("a solve starts from a solution, and one of another size is refused by its name", async () => {
  const first = await client.solve(corner);
  const again = await client.solve(corner, { warmStart: first });
  assert.equal(again.factorizations, 1);
  assert.deepEqual(again.z, first.z);
  const other = { g: [1, 1], C: [[1, 0], [0, 1]], d: [0, 0] };
  await assert.rejects(client.solve(other, { warmStart: first }), { field: "warmStart.z" });
});

test("a solution is readable as text and in the console", async () => {
  const solution = await client.solve(corner);
  assert.match(String(solution), /^solved: objective 2, \d+ iterations, \d+ factorizations, \S+ ms, violation \S+, 1 node; proved optimal$/);
  assert.match(inspect(solution), /^Solution solved: .*Float64Array\(3\)/s);
  assert.match(inspect(await client.solve(long, { options: { ...endless, maxIterations: 1 } })), /5994 more items/);
});

test("info returns version, limits and options of the server", async () => {
  const info = await client.info();
  assert.match(info.version, /^\d+\.\d+\.\d+/);
  assert.equal(info.workers, 1);
  assert.equal(info.limits.batchWindow, 64);
  const path = info.options.find((option) => option.name === "path");
  assert.equal(path?.type, "choice");
  assert.deepEqual(path?.choices, ["fast", "paper", "algorithm1"]);
});

const tables = new URL("../../../../tests/answers/", import.meta.url);
const read = (name: string): unknown => JSON.parse(readFileSync(new URL(name, tables), "utf8"));

type Case = { kind: string; text: string; what_to_try: string; facts: Record<string, never> };

test("the kinds of answers follow the table of cases that all languages have", () => {
  for (const { kind, text, what_to_try, facts } of read("kinds.json") as Case[]) {
    const { b_stationary: bStationary, second_order: secondOrder, budget_spent: budgetSpent, global_search: globalSearch } = facts;
    const words = { proved: false, objective: 0, gap: Infinity, starts: 1, ...facts };
    const given = { ...words, bStationary, secondOrder, budgetSpent, globalSearch } as unknown as SolutionFacts;
    assert.deepEqual([kindOf(given), kindText(given), whatToTry(given)], [kind, text, what_to_try]);
  }
});

test("a budget is spent as the table of cases that all languages have says", () => {
  type Budget = { options: Record<string, number>; factorizations: number; detail: string; spent: boolean };
  for (const { options, factorizations, detail, spent } of read("budgets.json") as Budget[]) {
    const { max_local_search_factorizations: maxLocalSearchFactorizations, num_starts: numStarts, effort } = options;
    const used = { maxLocalSearchFactorizations, numStarts, effort };
    const solution = new Solution("", Message.fromPartial({ status: 1, factorizations, detail, options: used }));
    assert.equal(solution.whatToTry.includes("spent max_local_search_factorizations"), spent, solution.whatToTry);
  }
});
