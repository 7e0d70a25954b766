import assert from "node:assert/strict";
import { after, before } from "node:test";

import { type Client, InvalidProblemError, PreconditionError, type SampleAverageStage, connect } from "@marble/client";

import { corner } from "./support/problems.js";
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
