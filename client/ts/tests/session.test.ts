import assert from "node:assert/strict";
import { after, before } from "node:test";

import {
  AbortedError,
  type Client,
  DeadlineError,
  InvalidProblemError,
  PreconditionError,
  type Session,
  SupersededError,
  UnavailableError,
  connect,
  shiftByStage,
} from "@marble/client";

import { chain, corner, endless, example, long } from "./support/problems.js";
import { Server, eventually } from "./support/server.js";
import { test } from "./support/test.js";

let server: Server;
let client: Client;

before(async () => {
  server = await Server.start();
  client = connect(server.address);
});

after(async () => {
  client.close();
  await server[Symbol.asyncDispose]();
});

test("an update without changes solves the problem of the set-up", async () => {
  await using session = await client.session(corner);
  assert.match(session.jobId, /\S/);
  assert.ok(session.memoryBytes > 0 && session.idleTimeoutS > 0);
  const solution = await session.update();
  assert.deepEqual(solution.z, (await client.solve(corner)).z);
  assert.equal(solution.jobId, session.jobId);
});

test("the data of an update stay: vectors, constants, values and whole matrices", async () => {
  await using session = await client.session(corner);
  const once = await session.update({ g: Float64Array.of(-2, -2, -2), c0: 3 });
  assert.ok(Math.abs(once.z[2] - 1) < 1e-6);
  const values = await session.update({ Q: [2, 2, 1] });
  const matrix = await session.update({
    Q: [
      [2, 0, 0],
      [0, 2, 0],
      [0, 0, 1],
    ],
  });
  for (const solution of [values, matrix]) {
    assert.ok(Math.abs(solution.z[2] - 2) < 1e-6);
  }
  const offset = await session.update({ d: [1.5] });
  assert.ok(Math.abs(offset.z[2] - 1.5) < 1e-6);
});

test("a warm start needs fewer factorizations than a cold one", async () => {
  const problem = example("hopper", "--steps", "30");
  await using session = await client.session(problem);
  const first = await session.update();
  const g = problem.g.map((value) => 1.001 * value);
  const warm = await session.update({ g });
  const cold = await session.update({ g }, { cold: true });
  assert.ok(first.solved && warm.solved && cold.solved);
  assert.ok(warm.factorizations < cold.factorizations);
});

test("a shift moves the last solution by one stage", async () => {
  const problem = chain(20);
  assert.deepEqual(shiftByStage(problem, 20), {
    variables: [{ first: 0, count: 60, by: 3 }],
    equalities: [{ first: 0, count: 20, by: 1 }],
    inequalities: [{ first: 0, count: 40, by: 2 }],
    pairs: [{ first: 0, count: 20, by: 1 }],
  });
  await using session = await client.session(problem);
  await session.update();
  const moved = problem.g.map((_, k) => (k % 3 === 0 ? Math.sin(0.1 * (k / 3 + 1)) : 0));
  const solution = await session.update({ g: moved }, { shift: shiftByStage(problem, 20) });
  assert.ok(solution.solved);
  const fresh = await client.solve({ ...problem, g: moved });
  assert.ok(Math.abs(solution.objective - fresh.objective) < 1e-6);
});

test("an update in two parts has the bits of one update", async () => {
  const problem = example("hopper", "--steps", "12");
  await using whole = await client.session(problem);
  await using parts = await client.session(problem);
  await Promise.all([whole.update(), parts.update()]);
  const g = problem.g.map((value) => 1.01 * value);
  const b = problem.b?.map((value) => 1.01 * value);
  const shift = shiftByStage(problem, 12);
  const one = await whole.update({ g, b }, { shift });
  parts.prepare({ g }, { shift });
  const two = await parts.update({ b });
  assert.deepEqual(two.z, one.z);
  assert.equal(two.factorizations, one.factorizations);
  assert.throws(() => parts.prepare({ g: [1] }), InvalidProblemError);
  parts.prepare({ c0: 1 }, { options: { rhoMax: 0 } }); // the server's rule
  await assert.rejects(parts.update(), InvalidProblemError);
  assert.ok((await parts.update()).solved);
});

test("stages that do not divide the problem are refused, as in every language", () => {
  const wrong = { name: "InvalidProblemError", field: "stages" };
  const bound = "must divide the number of variables, 60";
  assert.throws(() => shiftByStage(chain(20), 7), { ...wrong, value: "7", bound });
  assert.throws(() => shiftByStage(chain(20), 3), { ...wrong, bound: "must divide the number of equalities, 20" });
  for (const value of [0, -1, 2.5])
    assert.throws(() => shiftByStage(chain(20), value), { ...wrong, bound: "must be a whole number >= 1" });
});

test("concurrent updates are solved in their order", async () => {
  await using session = await client.session(corner);
  const order: number[] = [];
  const updates = [0, 1, 2, 3].map(async (k) => {
    const solution = await session.update({ g: [-2, -2, -0.5 * k] });
    order.push(k);
    return solution.z[2];
  });
  const heights = await Promise.all(updates);
  assert.deepEqual(order, [0, 1, 2, 3]);
  heights.forEach((height, k) => assert.ok(Math.abs(height - 0.25 * k) < 1e-6));
});

test("an invalid update names its field, is not sent, and the session continues", async () => {
  await using session = await client.session(corner);
  await assert.rejects(session.update({ g: [1, 2] }), { name: "InvalidProblemError", field: "g", value: "2 entries" });
  await assert.rejects(session.update({ A: [[1, 0, 0]] }), { name: "InvalidProblemError", field: "A" });
  await assert.rejects(session.update({ L: [[0, 1, 0]] }), { field: "L", value: "an entry at (0, 1)" });
  await assert.rejects(session.update({}, { deadlineMs: -1 }), { field: "deadlineMs" });
  await assert.rejects(session.update({}, { shift: { pairs: [{ first: 0, count: 1, by: 0.5 }] } }), {
    field: "shift.pairs[0].by",
  });
  await assert.rejects(session.update({}, { options: { rhoMax: 0 } }), InvalidProblemError); // the server's rule
  assert.ok(session.isOpen);
  assert.ok((await session.update()).solved);
});

test("an update that misses its deadline returns its best point, or a DeadlineError if it did not begin", async () => {
  await using session = await client.session(long, { options: endless });
  const late = session.update({}, { deadlineMs: 500 });
  const waits = assert.rejects(session.update({}, { deadlineMs: 1 }), DeadlineError);
  assert.equal((await late).status, "time_limit");
  await waits;
  const solution = await session.update({}, { cold: true, options: { maxIterations: 2 } });
  assert.equal(solution.status, "iteration_limit");
});

test("with latestOnly a waiting update is replaced by the next", async () => {
  await using own = await Server.start(["--workers", "1"]);
  using planner = connect(own.address);
  await using session = await planner.session(corner, { latestOnly: true });
  const { jobId } = await planner.jobs.submit(long, { options: endless, priority: "realtime" }); // is not preempted
  await eventually(async () => (await planner.info()).counters.running === 1);
  const updates = [1, 2, 3, 4].map((c0) => session.update({ c0 })); // the first waits for the worker, the second for the first
  await assert.rejects(updates[1], SupersededError);
  await assert.rejects(updates[2], SupersededError);
  await planner.jobs.cancel(jobId);
  assert.ok((await updates[0]).solved && (await updates[3]).solved);
});

test("progress has the number of its update", async () => {
  const sequences: number[] = [];
  await using session = await client.session(corner, { onProgress: (_, sequence) => sequences.push(sequence) });
  await session.update();
  await session.update({ g: [-4, -2, 0] }, { cold: true });
  assert.deepEqual([...new Set(sequences)], [1, 2]);
});

test("close finishes sent updates, and later updates are refused", async () => {
  const session = await client.session(corner);
  const answers = [session.update(), session.update({ c0: 1 })];
  await session.close();
  assert.ok((await Promise.all(answers)).every((solution) => solution.solved));
  assert.equal(session.isOpen, false);
  await assert.rejects(session.update(), PreconditionError);
  await eventually(async () => (await client.info()).counters.sessions === 0);
});

test("an abort signal cancels the whole session", async () => {
  const controller = new AbortController();
  const session = await client.session(long, { options: endless, signal: controller.signal });
  const answer = session.update();
  setTimeout(() => controller.abort(), 50);
  await assert.rejects(answer, { name: "CancelledError" });
  assert.equal(session.isOpen, false);
  await eventually(async () => (await client.info()).counters.sessions === 0);
});

test("a set-up that the server refuses rejects", async () => {
  await assert.rejects(client.session(corner, { options: { rhoMax: 0 } }), {
    name: "InvalidProblemError",
    field: "options.rhoMax",
  });
});

test("a session that is idle for too long ends with AbortedError", async () => {
  await using own = await Server.start(["--session-idle-s", "1"]);
  using planner = connect(own.address);
  const session = await planner.session(corner);
  assert.equal(session.idleTimeoutS, 1);
  await eventually(() => !session.isOpen);
  await assert.rejects(session.update(), AbortedError);
});

test("a session whose server is lost ends with UnavailableError; a new one opens after the restart", async () => {
  await using own = await Server.start();
  using planner = connect(own.address);
  const session = await planner.session(long, { options: endless });
  const answer = assert.rejects(session.update(), UnavailableError);
  await own.restart();
  await answer;
  assert.equal(session.isOpen, false);
  await assert.rejects(session.update(), UnavailableError);
  await using next = await reopened(planner);
  assert.ok((await next.update()).solved);
});

async function reopened(planner: Client): ReturnType<Client["session"]> {
  const opened: Session[] = [];
  await eventually(async () => {
    try {
      opened.push(await planner.session(corner));
    } catch (error) {
      if (!(error instanceof UnavailableError)) throw error;
    }
    return opened.length > 0;
  });
  return opened[0];
}
