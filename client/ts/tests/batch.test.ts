import assert from "node:assert/strict";
import { after, before } from "node:test";
import { setTimeout as sleep } from "node:timers/promises";

import { type BatchProblem, type Client, InvalidProblemError, type Problem, connect } from "@marble/client";

import { chain, corner, endless, long } from "./support/problems.js";
import { Server, eventually } from "./support/server.js";
import { test } from "./support/test.js";

let server: Server;
let client: Client;

before(async () => {
  server = await Server.start(["--workers", "1", "--batch-window", "2"]);
  client = connect(server.address);
});

after(async () => {
  client.close();
  await server[Symbol.asyncDispose]();
});

test("every problem has one result, with its tag", async () => {
  const problems = Array.from({ length: 50 }, (_, k) => ({ tag: `p${k}`, problem: { ...corner, c0: k } }));
  const objectives = new Map<string, number>();
  for await (const { tag, solution } of client.batch(problems)) {
    assert.ok(!objectives.has(tag) && solution?.solved);
    objectives.set(tag, solution.objective);
  }
  assert.equal(objectives.size, 50);
  for (let k = 0; k < 50; ++k) assert.ok(Math.abs((objectives.get(`p${k}`) ?? NaN) - (k - 9)) < 1e-6);
});

test("an invalid problem has its error as result, and the others continue", async () => {
  const problems: BatchProblem<number>[] = [
    { tag: 0, problem: { ...corner, g: [NaN, 0, 0] } },
    { tag: 1, problem: corner },
    { tag: 2, problem: corner, options: { rhoMax: 0 } },
    { tag: 3, problem: corner },
    { tag: 4, problem: { ...corner, d: [] } },
  ];
  const outcomes = new Map<number, unknown>();
  for await (const { tag, solution, error } of client.batch(problems)) outcomes.set(tag, error ?? solution.status);
  assert.equal(outcomes.size, 5);
  assert.deepEqual([outcomes.get(1), outcomes.get(3)], ["solved", "solved"]);
  for (const tag of [0, 2, 4]) assert.ok(outcomes.get(tag) instanceof InvalidProblemError);
});

test("a source faster than the server is slowed down", async () => {
  let taken = 0;
  async function* endlessly(problem: Problem): AsyncGenerator<BatchProblem<number>> {
    for (;;) {
      yield { tag: ++taken, problem, options: endless };
      await sleep(0);
    }
  }
  // Only the test ends solves, so that no side's speed matters: the server takes two problems, and about 30 MB more
  // (1.8 MB each) are in HTTP/2's windows and the kernel's buffers. An unlimited source would be read at each turn of
  // the loop.
  const running = async (): Promise<string | undefined> =>
    (await client.jobs.list({ states: ["running"] })).jobs[0]?.jobId;
  const answers = client.batch(endlessly(chain(10_000)));
  for (let answered = 0; answered < 5; ++answered) {
    const answer = answers.next();
    await eventually(async () => (await running()) !== undefined && (await client.info()).counters.queued === 1);
    await client.jobs.cancel((await running()) ?? "");
    const { value } = await answer;
    assert.equal(value?.solution?.status, "cancelled");
  }
  for (let turns = 0; turns < 200; ++turns) await client.info();
  assert.ok(taken < 5 + 64, `${taken} taken for 5 answers`);
  await answers.return(undefined);
  await eventually(async () => (await client.info()).counters.running === 0);
});

test("leaving the loop or aborting the signal cancels the whole batch", async () => {
  const problems = Array.from({ length: 8 }, (_, tag) => ({
    tag,
    problem: tag === 0 ? corner : long,
    options: tag === 0 ? {} : endless,
  }));
  for await (const { tag } of client.batch(problems)) {
    assert.equal(tag, 0);
    break;
  }
  await eventually(async () => (await client.info()).counters.running === 0);
  const controller = new AbortController();
  await assert.rejects(
    async () => {
      for await (const { tag } of client.batch(problems, { signal: controller.signal })) {
        assert.equal(tag, 0);
        controller.abort();
      }
    },
    { name: "CancelledError" },
  );
  await eventually(async () => (await client.info()).counters.running === 0);
});

test("an error thrown by the source reaches the caller", async () => {
  function* broken(): Generator<BatchProblem<number>> {
    yield { tag: 1, problem: corner };
    throw new Error("no more of these");
  }
  await assert.rejects(async () => {
    for await (const { tag } of client.batch(broken())) assert.equal(tag, 1);
  }, /no more of these/);
});

test("an empty batch ends at once", async () => {
  for await (const answer of client.batch([])) assert.fail(String(answer.tag));
});
