import assert from "node:assert/strict";
import { after, before } from "node:test";

import {
  type Client,
  connect,
  type CoupledProblem,
  InvalidProblemError,
  PreconditionError,
  type Problem,
  type Progress,
  type SampleAverageStage,
} from "@marble/client";

import { chain, corner } from "./support/problems.js";
import { Server } from "./support/server.js";
import { test } from "./support/test.js";

let server: Server;
let client: Client;

before(async () => {
  server = await Server.start(["--workers", "2"]);
  client = connect(server.address);
});

after(async () => {
  client.close();
  await server[Symbol.asyncDispose]();
});

// (x, y): x units bought for 1, y sold for 3 up to the demand; storage costs x² / 20.
const shop = {
  Q: [
    [0.1, 0],
    [0, 0],
  ],
  g: [1, -3],
  L: [[0, -1]],
  l: [5],
  R: [[1, -1]],
  r: [0],
};
const demands = [1, 9, 3, 7, 2, 8, 4, 6];
const scenarios = { entries: [{ part: "left_offset" as const }], values: demands.map((demand) => [demand]) };

test("scenarios as a table give stages and then the plan for all of them", async () => {
  const stages: SampleAverageStage[] = [];
  const answer = await client.scenarios(shop, { firstStage: [0], scenarios, onStage: (stage) => stages.push(stage) });
  assert.deepEqual(
    stages.map((stage) => stage.scenarios),
    [1, 2, 4, 8],
  );
  assert.deepEqual(answer.stages, stages);
  assert.equal(answer.end, "samples");
  assert.equal(answer.solution.status, "solved");
  assert.equal(answer.x.length, 1);
  assert.equal(answer.recourse.length, 8);
  answer.recourse.forEach((y, s) => assert.ok(y[0]! <= Math.min(answer.x[0]!, demands[s]!) + 1e-9));
  const { job } = await client.jobs.get(answer.solution.jobId);
  assert.equal(job.kind, "scenarios");
  assert.equal(job.sampleAverageStages.length, 4);
});

test("the server draws the same scenarios for the same seed", async () => {
  const quantities = [{ location: -5, scale: 10, effects: [{ entries: scenarios.entries[0]!, gains: [1] }] }];
  const draw = (seed: number) =>
    client.scenarios(shop, { firstStage: [0], scenarios: { seed, quantities }, maxSampleSize: 16 });
  const [one, same, other] = await Promise.all([draw(7), draw(7), draw(8)]);
  assert.deepEqual(same.solution.z, one.solution.z);
  assert.notDeepEqual(other.solution.z, one.solution.z);
});

test("a submitted job has the plan later, a job without scenarios has none", async () => {
  const { jobId } = await client.jobs.submitScenarios(shop, { firstStage: [0], scenarios });
  assert.equal((await client.jobs.scenarios(jobId, { wait: true })).scenarios, 8);
  const plain = await client.jobs.submit(corner);
  await assert.rejects(client.jobs.scenarios(plain.jobId, { wait: true }), PreconditionError);
});

test("invalid parts are named", async () => {
  const rejects = (controls: object, field: string) =>
    assert.rejects(client.scenarios(shop, { firstStage: [0], scenarios, ...controls }), (error) => {
      assert.ok(error instanceof InvalidProblemError, String(error));
      assert.equal(error.field, field);
      return true;
    });
  await rejects({ firstStage: [] }, "scenarios.firstStage");
  await rejects({ growth: 1 }, "scenarios.growth");
  await rejects({ scenarios: { ...scenarios, values: [[1], [1, 2]] } }, "scenarios.values");
  await rejects({ scenarios: { entries: [{ part: "height" }], values: [[1]] } }, "part");
});

/** ½(force − wanted)², 0 ≤ force ⊥ gap ≥ 0, of (force, gap), where the gap costs. */
const arm = (wanted: number, name = ""): Problem => ({
  name,
  Q: [
    [1, 0],
    [0, 1],
  ],
  g: [-wanted, 0.1],
  L: [[1, 0]],
  R: [[0, 1]],
});
const coupling = [[1, 0]];
const cell: CoupledProblem = {
  name: "cell",
  blocks: [
    { problem: arm(3), coupling },
    { problem: arm(2), coupling },
  ],
  couplingRhs: [4],
};

// Three variables per stage.
const long = chain(30);
const stages = long.g.map((_, j) => Math.floor(j / 3));

const near = (actual: ArrayLike<number>, expected: number[]): void => {
  assert.equal(actual.length, expected.length);
  expected.forEach((value, j) => assert.ok(Math.abs(actual[j]! - value) < 1e-7, `${actual[j]} is not ${value}`));
};

test("coupled blocks share a resource with one multiplier", async () => {
  const rows: Progress[] = [];
  const answer = await client.coupled(cell, { onProgress: (row) => rows.push(row) });
  assert.equal(answer.solution.status, "solved");
  assert.equal(answer.coordination.status, "solved");
  near(
    answer.z.map((z) => z[0]!),
    [2.5, 1.5],
  );
  near(answer.couplingMultipliers, [0.5]);
  near(answer.solution.equalityMultipliers.slice(-1), [0.5]);
  assert.equal(rows.length, answer.coordination.iterations);
  assert.ok(rows.at(-1)!.violations.equality <= 1e-6 && rows.at(-1)!.rho > 0);
  const { job } = await client.jobs.get(answer.solution.jobId);
  assert.equal(job.kind, "coupled");
  assert.equal(job.problemName, "cell");
});

test("a block without coupling and initial multipliers are accepted", async () => {
  const apart = { blocks: [cell.blocks[0]!, { problem: arm(2) }], couplingRhs: [1] };
  const answer = await client.coupled(apart, { couplingMultipliers: [2], options: { maxIterations: 50 } });
  near(
    answer.z.map((z) => z[0]!),
    [1, 2],
  );
  near(answer.couplingMultipliers, [2]);
});

test("without the monolithic solve the solution is that of the blocks", async () => {
  const { coordination, solution } = await client.coupled(cell, { monolithic: false, tolerance: 1e-6 });
  assert.equal(coordination.status, "solved");
  assert.equal(solution.objective, coordination.blocksObjective);
});

test("the block that failed is named", async () => {
  const never = { ...arm(3, "elbow"), C: [[1, 0], [-1, 0]], d: [-1, 0] };
  const { solution, coordination } = await client.coupled({
    ...cell,
    blocks: [cell.blocks[0]!, { problem: never, coupling }],
  });
  assert.equal(solution.status, "infeasible");
  assert.equal(coordination.failedBlock, 1);
  assert.match(coordination.detail, /block 1 \(elbow\)/);
});

test("a long problem in segments has the solution of the whole problem", async () => {
  const whole = await client.solve(long);
  const { solution, coordination } = await client.segments(long, { stages, numSegments: 3, overlap: 2 });
  assert.equal(solution.status, "solved");
  assert.equal(solution.z.length, long.g.length);
  near([solution.objective], [whole.objective]);
  assert.ok(coordination.sweepObjective! >= solution.objective - 1e-9);
});

test("submitted problems have the same bits later, other jobs have no coordination", async () => {
  const blocks = await client.jobs.submitCoupled(cell);
  const later = await client.jobs.coupled(blocks.jobId, cell.blocks, { wait: true });
  const now = await client.coupled(cell);
  assert.deepEqual(later.z, now.z);
  assert.deepEqual(later.couplingMultipliers, now.couplingMultipliers);
  const cut = { stages, numSegments: 3 };
  const segments = await client.jobs.submitSegments(long, cut);
  const [one, other] = await Promise.all([
    client.jobs.segments(segments.jobId, { wait: true }),
    client.segments(long, cut),
  ]);
  assert.deepEqual(one.solution.z, other.solution.z);
  await assert.rejects(
    client.jobs.coupled(blocks.jobId, cell.blocks.slice(1)),
    (error) => error instanceof InvalidProblemError && error.field === "blocks",
  );
  const plain = await client.jobs.submit(corner);
  await assert.rejects(client.jobs.segments(plain.jobId, { wait: true }), PreconditionError);
});

test("invalid parts are named by the client and by the server", async () => {
  const rejects = async (call: Promise<unknown>, field: string, index?: number): Promise<void> =>
    assert.rejects(call, (error) => {
      assert.ok(error instanceof InvalidProblemError, String(error));
      assert.equal(error.field, field);
      assert.equal(error.index, index);
      return true;
    });
  const [left] = cell.blocks;
  const second = (problem: Problem, own = coupling): CoupledProblem => ({
    ...cell,
    blocks: [left!, { problem, coupling: own }],
  });
  await rejects(client.coupled({ ...cell, blocks: 3 as never }), "coupled.blocks");
  await rejects(client.coupled({ ...cell, blocks: [] }), "coupled.blocks");
  await rejects(client.coupled({ ...cell, couplingRhs: [NaN] }), "coupled.couplingRhs", 0);
  await rejects(client.coupled(second({ ...arm(2), g: [0, Infinity] })), "coupled.blocks[1].problem.g", 1);
  await rejects(client.coupled(second({ ...arm(2), R: [] })), "coupled.blocks[1].problem.R.rows");
  await rejects(client.coupled(second(arm(2), [...coupling, ...coupling])), "coupled.blocks[1].coupling.rows");
  await rejects(client.coupled(cell, { couplingMultipliers: [1, 2] }), "coupled.couplingMultipliers");
  await rejects(client.coupled(cell, { proximal: "much" as never }), "coupled.proximal");
  await rejects(client.coupled(cell, { proximal: -1 }), "coupled.proximal");
  await rejects(client.coupled(cell, { maxPairSwitches: 0.5 }), "coupled.maxPairSwitches");
  await rejects(client.segments(long, { stages: [0], numSegments: 2 }), "coupled.segments.stages");
  await rejects(client.segments(long, { stages: stages.map((s) => s - 1), numSegments: 2 }), "coupled.segments.stages", 0);
  await rejects(client.segments(long, { stages, numSegments: 0 }), "coupled.segments.numSegments");
  await rejects(client.segments(long, { stages, numSegments: 2, overlap: -2 }), "coupled.segments.overlap");
});
