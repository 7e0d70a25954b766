import assert from "node:assert/strict";
import { after, before } from "node:test";

import { status } from "@grpc/grpc-js";
import {
  AbortedError,
  type Client,
  connect,
  DeadlineError,
  InvalidProblemError,
  PreconditionError,
  type Reopening,
  type Session,
  type SessionControls,
  shiftByStage,
  SupersededError,
  UnavailableError,
} from "@marble/client";

import { chain, corner, endless, example, long } from "./support/problems.js";
import { eventually, Server, streamingStandIn } from "./support/server.js";
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

// Sessions that outlive their servers.
const stages = 20;
const problem = chain(stages);
const shift = shiftByStage(problem, stages);
const costs = (by: number): number[] => problem.g.map((value, k) => (k % 3 === 0 ? value + by : value));

/** Long waits for slow machines. */
const patient = { reopen: true, reopenMs: 60_000 };

function moveOn(z: Float64Array): Float64Array {
  return z.slice().copyWithin(0, 3);
}

test("the next update reopens a lost session from the shifted last z, and reports it once", async () => {
  await using server = await Server.start();
  using client = connect(server.address);
  const reopenings: Reopening[] = [];
  await using session = await client.session(problem, { reopen: true, onReopen: (one) => reopenings.push(one) });
  const { jobId } = session;
  const before = await session.update({ g: costs(0.1) });
  await server.restart();
  const answer = await session.update({ c0: 3 }, { shift });
  assert.ok(answer.solved && session.isOpen);
  assert.equal(session.reopened, 1);
  assert.deepEqual(reopenings.map(({ epoch }) => epoch), [1]);
  assert.ok(reopenings[0].cause instanceof UnavailableError);
  assert.notEqual(session.jobId, jobId);
  assert.deepEqual([reopenings[0].jobId, answer.jobId], [session.jobId, session.jobId]);

  const start = { initialPoint: moveOn(before.z) };
  await using fresh = await client.session({ ...problem, g: costs(0.1), c0: 3 }, start);
  const same = await fresh.update();
  assert.deepEqual([answer.z, answer.iterations], [same.z, same.iterations]);

  await session.update(); // and goes on warm, under its epoch
  await server.restart();
  assert.ok((await session.update()).solved);
  assert.deepEqual(reopenings.map(({ epoch }) => epoch), [1, 2]);
});

test("unfinished updates of a lost server are solved by the next one, in their order", async () => {
  await using server = await Server.start();
  using client = connect(server.address);
  let begun = (): void => undefined;
  const running = new Promise<void>((done) => (begun = done));
  const controls = { ...patient, options: { ...endless, timeLimitS: 1 }, onProgress: () => begun() };
  await using session = await client.session(long, controls);
  const order: number[] = [];
  const updates = [0, 1, 2].map(async (k) => {
    const answer = await session.update({ c0: k }, { options: k > 0 ? { maxIterations: 1 } : {} });
    order.push(k);
    return answer;
  });
  await running;
  await server.restart();
  const answers = await Promise.all(updates);
  assert.deepEqual(order, [0, 1, 2]);
  assert.deepEqual(answers.map(({ status }) => status), ["time_limit", "iteration_limit", "iteration_limit"]);
  assert.equal(session.reopened, 1);
  assert.ok(answers.every(({ jobId }) => jobId === session.jobId));
});

test("a reopened session has the current data, options and start, without those of refused updates", async () => {
  await using server = await Server.start();
  using client = connect(server.address);
  const full = { ...corner, Q: [[2, 0.5, 0], [0.5, 2, 0], [0, 0, 2]] };
  await using session = await client.session(full, patient);
  await session.update({ g: [-2, -2, -2], d: [1.5] });
  // In the values of Q (compressed columns) the lower triangle is ignored.
  await session.update({ Q: [3, 99, 1, 3, 1] }, { options: { maxIterations: 77 } });
  await session.update({ l: [0.25] }, { initialPoint: [1, 0, 0] });
  await assert.rejects(session.update({ c0: 1e9 }, { options: { rhoMax: 0 } }), InvalidProblemError);
  await server.restart();
  const answer = await session.update({ c0: 5 }, { cold: true });
  const now = { ...full, Q: [[3, 1, 0], [1, 3, 0], [0, 0, 1]], g: [-2, -2, -2], c0: 5, d: [1.5], l: [0.25] };
  const fresh = await client.solve(now, { options: { maxIterations: 77 }, initialPoint: [1, 0, 0] });
  assert.deepEqual([answer.objective, answer.z], [fresh.objective, fresh.z]);
  assert.equal(answer.options.maxIterations, 77);
});

test("the data of a superseded update take effect with the next one, not earlier", async () => {
  await using server = await Server.start(["--workers", "1"]);
  using client = connect(server.address);
  await using session = await client.session(corner, { ...patient, latestOnly: true });
  await client.jobs.submit(long, { options: endless, priority: "realtime" });
  await eventually(async () => (await client.info()).counters.running === 1);
  const running = session.update({ g: [-2, -2, -2] }); // waits for the worker
  await eventually(async () => (await client.info()).counters.queued === 1);
  const overtaken = session.update({ c0: 7 });
  const newest = session.update({ d: [0.5] });
  await assert.rejects(overtaken, SupersededError);
  const outcomes = Promise.allSettled([running, newest]);
  await server.restart();
  const [first, second] = await outcomes;
  // Both wait at the next server for a moment, where the older one may be superseded, too.
  if (first.status === "fulfilled") assert.ok(Math.abs(first.value.objective - 9) < 1e-6);
  else assert.ok(first.reason instanceof SupersededError);
  assert.ok(second.status === "fulfilled" && Math.abs(second.value.objective - 5.25) < 1e-6);
  assert.equal(session.reopened, 1);
});

test("a first part that a lost server has taken is sent to the next one with its second part", async () => {
  await using server = await Server.start();
  using client = connect(server.address);
  await using session = await client.session(problem, patient);
  const before = await session.update();
  session.prepare({ g: costs(0.2) }, { shift });
  await server.restart();
  const answer = await session.update({ b: problem.b.map(() => 0.01) });
  await using fresh = await client.session(problem, { initialPoint: moveOn(before.z) });
  const same = await fresh.update({ g: costs(0.2), b: problem.b.map(() => 0.01) });
  assert.deepEqual([answer.z, answer.iterations], [same.z, same.iterations]);
});

test("each opening has the next epoch, and results of other epochs are ignored", async () => {
  const epochs: number[][] = [];
  let calls = 0;
  // The epoch is the last field of a message: the tenth of a request, absent if 0.
  const epochOf = (request: Buffer): number => (request.at(-2) === 0x50 ? request[request.length - 1] : 0);
  // The result of update 1, whose detail is one letter.
  const answer = (epoch: number, detail: number): Buffer =>
    Buffer.from([0x1a, 0x09, 0x08, 0x01, 0x12, 0x03, 0x12, 0x01, detail, 0x20, epoch]);
  const anywhere = await streamingStandIn("/marble.v1.Solver/Session", (call) => {
    const epoch = calls++;
    const seen: number[] = [];
    epochs.push(seen);
    call.on("data", (request: Buffer) => {
      seen.push(epochOf(request));
      if (seen.length === 1) return void call.write(Buffer.from([0x0a, 0x02, 0x28, epoch]));
      if (epoch === 0) return void call.emit("error", { code: status.UNAVAILABLE, details: "leaves" });
      call.write(answer(epoch - 1, 0x61));
      call.write(answer(epoch + 1, 0x62));
      call.write(answer(epoch, 0x63));
    });
    call.on("end", () => call.end());
  });
  try {
    using client = connect(anywhere.address);
    await using session = await client.session(corner, patient);
    assert.equal((await session.update()).detail, "c");
    assert.deepEqual(epochs, [[0, 0], [1, 1]]);
  } finally {
    anywhere.stop();
  }
});

/** A session, its server, and another server. */
async function onOneOfTwo(
  servers: [Server, Server],
  client: Client,
  controls: SessionControls,
): Promise<[Session, Server, Server]> {
  const session = await client.session(long, { ...controls, ...patient });
  using first = connect(servers[0].address);
  const [own, other] = (await first.info()).counters.sessions === 1 ? servers : [servers[1], servers[0]];
  return [session, own, other];
}

test("a session leaves a draining server after the running update", async () => {
  await using one = await Server.start(["--drain-grace-s", "60"]);
  await using another = await Server.start();
  using client = connect(`${one.address},${another.address}`);
  const settings = { options: { ...endless, timeLimitS: 1 }, onProgress: () => begun() };
  let begun = (): void => undefined;
  const running = new Promise<void>((done) => (begun = done));
  const [session, own, other] = await onOneOfTwo([one, another], client, settings);
  const { jobId } = session;
  const first = session.update();
  await running;
  own.signal("SIGTERM");
  using direct = connect(own.address, { waitMs: 0 });
  await eventually(() => direct.jobs.submit(corner).then(() => false, () => true));
  const second = session.update({ c0: 1 }, { options: { maxIterations: 1 } }); // which the server refuses
  assert.deepEqual([(await first).status, (await first).jobId], ["time_limit", jobId]);
  assert.equal((await second).status, "iteration_limit");
  assert.notEqual((await second).jobId, jobId);
  assert.equal(session.reopened, 1);
  using there = connect(other.address);
  assert.equal((await there.info()).counters.sessions, 1);
  await session.close();
});

test("a session whose server does not come back in time ends with UnavailableError", async () => {
  await using server = await Server.start();
  using client = connect(server.address);
  const session = await client.session(corner, { reopen: true, reopenMs: 300 });
  await session.update();
  await server.kill();
  await assert.rejects(session.update(), UnavailableError);
  assert.equal(session.isOpen, false);
  assert.equal(session.reopened, 0);
  await assert.rejects(session.update(), UnavailableError);
  await session.close();
});

test("closing a lost session opens none, unless updates wait for their results", async () => {
  await using server = await Server.start();
  using client = connect(server.address);
  const idle = await client.session(corner, patient);
  const busy = await client.session(corner, patient);
  await server.kill();
  await idle.close();
  assert.equal(idle.reopened, 0);
  const answer = busy.update();
  const closed = busy.close();
  await server.restart();
  await closed;
  assert.ok((await answer).solved);
});

test("a signal ends the attempts to reopen", async () => {
  await using server = await Server.start();
  using client = connect(server.address);
  const controller = new AbortController();
  const session = await client.session(corner, { reopen: true, reopenMs: 1e9, signal: controller.signal });
  await server.kill();
  const answer = session.update();
  controller.abort();
  await assert.rejects(answer, { name: "CancelledError" });
  assert.equal(session.isOpen, false);
});

test("an error thrown by onReopen ends the session", async () => {
  await using server = await Server.start();
  using client = connect(server.address);
  const onReopen = (): void => {
    throw new Error("not there");
  };
  const session = await client.session(corner, { ...patient, onReopen });
  await server.restart();
  await assert.rejects(session.update(), /not there/);
  assert.equal(session.isOpen, false);
  await assert.rejects(client.session(corner, { reopen: true, reopenMs: 0 }), { field: "reopenMs" });
});

test("an update waits for a server until its deadline; its data stay, and the session continues", async () => {
  await using server = await Server.start();
  using client = connect(server.address);
  await using session = await client.session(corner, patient);
  await session.update();
  await server.kill();
  for (const c0 of [4, 5]) {
    await assert.rejects(session.update({ c0 }, { deadlineMs: 20 }), UnavailableError);
    assert.ok(session.isOpen);
  }
  const waits = session.update({ d: [0.5] });
  await assert.rejects(session.update({ g: [-2, -2, -2] }, { deadlineMs: 20 }), /the deadline passed while the server was/);
  await server.restart();
  assert.ok((await waits).solved);
  const answer = await session.update();
  const fresh = await client.solve({ ...corner, c0: 5, d: [0.5], g: [-2, -2, -2] });
  assert.ok(Math.abs(answer.objective - fresh.objective) < 1e-9);
  assert.equal(session.reopened, 1);
});
