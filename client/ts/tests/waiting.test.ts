// Calls that wait for a lost server or for room in its queue.
import assert from "node:assert/strict";

import { Metadata, status } from "@grpc/grpc-js";
import {
  type BatchProblem,
  type Client,
  type ConnectOptions,
  DeadlineError,
  RefusedError,
  UnavailableError,
  connect,
} from "@marble/client";

import { corner, endless, long } from "./support/problems.js";
import { field, refusal, small, solved } from "./support/messages.js";
import { Server, eventually, streamingStandIn } from "./support/server.js";
import { test } from "./support/test.js";

/** A client that has reached its server, with a long wait for slow machines. */
async function known(address: string, options: ConnectOptions = { waitMs: 60_000 }): Promise<Client> {
  const client = connect(address, options);
  await client.info();
  return client;
}

test("calls wait for the restart of their server, ten seconds by default", async () => {
  await using server = await Server.start();
  using client = await known(server.address, {});
  await server.kill();
  const answers = [client.solve(corner), client.solve(corner, { onProgress: () => undefined }), client.info()];
  const [submitted, session] = [client.jobs.submit(corner), client.session(corner)];
  await server.restart();
  await Promise.all(answers);
  assert.ok((await client.jobs.result((await submitted).jobId, { wait: true })).solved);
  assert.ok((await (await session).update()).solved);
  await (await session).close();
});

test("a solve lost with its server is solved by the next one", async () => {
  await using server = await Server.start();
  using client = await known(server.address);
  const answer = client.solve(long, { options: { ...endless, timeLimitS: 1 } });
  using other = connect(server.address);
  await eventually(async () => (await other.info()).counters.running === 1);
  await server.restart();
  assert.equal((await answer).status, "time_limit");
});

test("waiting ends at the client's limit, the call's deadline or its signal", async () => {
  await using server = await Server.start();
  using impatient = await known(server.address, { waitMs: 0 });
  using limited = await known(server.address, { waitMs: 300 });
  using client = await known(server.address, { waitMs: 1e9 });
  await server.kill();
  await assert.rejects(impatient.solve(corner), UnavailableError);
  await assert.rejects(limited.solve(corner), UnavailableError);
  await assert.rejects(client.solve(corner, { deadlineMs: 300 }), (error: Error) => {
    assert.ok(error.cause instanceof UnavailableError || error.cause === undefined);
    return error instanceof DeadlineError;
  });
  const controller = new AbortController();
  const given = [
    client.solve(corner, { signal: controller.signal }),
    client.session(corner, { signal: controller.signal }),
    client.batch([{ tag: 1, problem: corner }], { signal: controller.signal }).next(),
  ];
  controller.abort();
  for (const call of given) await assert.rejects(call, { name: "CancelledError" });
  assert.throws(() => connect(server.address, { waitMs: -1 }), { name: "InvalidProblemError", field: "waitMs" });
});

const many = (count: number): BatchProblem<number>[] =>
  Array.from({ length: count }, (_, tag) => ({ tag, problem: { ...corner, c0: tag } }));

/** Reads a batch to its end: each of its problems must have one result. */
async function answeredOnce(client: Client, count: number, after: number, then: () => Promise<unknown>): Promise<void> {
  const tags = new Set<number>();
  for await (const { tag, solution } of client.batch(many(count))) {
    assert.ok(!tags.has(tag), `${tag} was answered twice`);
    assert.ok(solution?.solved && Math.abs(solution.objective - (tag - 9)) < 1e-6);
    tags.add(tag);
    if (tags.size === after) await then();
  }
  assert.equal(tags.size, count);
}

test("a batch continues after a restart and repeats only unsolved problems", async () => {
  await using server = await Server.start(["--workers", "1", "--batch-window", "3"]);
  using client = await known(server.address);
  await answeredOnce(client, 40, 5, () => server.restart());
  assert.ok((await client.info()).counters.answeredTotal <= 35);
});

for (const how of ["kill", "drain"] as const) {
  test(`a batch goes on at the next address: ${how}`, async () => {
    await using one = await Server.start(["--batch-window", "3"]);
    await using other = await Server.start(["--batch-window", "3"]);
    using client = await known(`${one.address},${other.address}`);
    const probes = [one, other].map((server) => connect(server.address));
    const answered = (probe: Client): Promise<number> => probe.info().then(({ counters }) => counters.answeredTotal);
    await answeredOnce(client, 40, 5, async () => {
      const [first, second] = await Promise.all(probes.map(answered));
      assert.ok(first + second >= 5);
      const own = first > second ? one : other;
      if (how === "kill") return own.kill();
      own.signal("SIGTERM");
    });
    probes.forEach((probe) => probe.close());
  });
}

test("an array is read to its end through restarts of its server", async () => {
  await using server = await Server.start(["--workers", "1", "--state-dir", "{directory}/state", "--job-starts", "9"]);
  using client = await known(server.address);
  const elements = Array.from({ length: 300 }, (_, k) => ({ update: { c0: k } }));
  const { jobId } = await client.jobs.submitArray(elements, { base: corner });
  const indices = new Set<number>();
  for await (const { index, sequence, solution } of client.jobs.array(jobId)) {
    assert.ok(!indices.has(index), `${index} was answered twice`);
    assert.ok(solution?.solved && Math.abs(solution.objective - (index - 9)) < 1e-6);
    indices.add(index);
    assert.equal(sequence, indices.size);
    if (sequence === 20 || sequence === 150) await server.restart();
  }
  assert.equal(indices.size, elements.length);
});

test("a batch without unsolved problems waits for its source, not for the server", async () => {
  await using server = await Server.start();
  using client = await known(server.address, { waitMs: 500 });
  let more = (): void => undefined;
  const wanted = new Promise<void>((done) => (more = done));
  async function* source(): AsyncGenerator<BatchProblem<number>> {
    yield* many(1);
    await wanted;
    yield* many(1);
  }
  const answers = client.batch(source());
  assert.ok((await answers.next()).value?.solution?.solved);
  const second = answers.next();
  await server.restart();
  more();
  assert.ok((await second).value?.solution?.solved);
  assert.equal((await answers.next()).done, true);
});

test("a batch whose server does not come back ends with UnavailableError", async () => {
  await using server = await Server.start();
  using client = await known(server.address, { waitMs: 300 });
  await server.kill();
  await assert.rejects(client.batch(many(3)).next(), UnavailableError);
});

test("a submission waits for room within its deadline", async () => {
  await using server = await Server.start(["--workers", "1", "--queue-jobs", "1", "--client-queued", "0"]);
  using client = await known(server.address);
  using impatient = connect(server.address, { waitMs: 0 });
  const busy = await client.jobs.submit(long, { options: endless });
  await eventually(async () => (await client.info()).counters.running === 1);
  await client.jobs.submit(corner);
  await assert.rejects(impatient.jobs.submit(corner), RefusedError);
  await assert.rejects(client.jobs.submit(corner, { deadlineMs: 300 }), (error: Error) => {
    assert.ok(error.cause instanceof RefusedError || error.cause === undefined);
    return error instanceof DeadlineError;
  });
  const refusals = (await client.info()).counters.refusedTotal;
  using first = connect(server.address); // whose first call that is, and which has no deadline
  const waits = [client.jobs.submit(corner, { deadlineMs: 120_000 }), first.jobs.submit(corner)];
  await eventually(async () => (await client.info()).counters.refusedTotal > refusals + 1);
  await client.jobs.cancel(busy.jobId);
  for (const { jobId } of await Promise.all(waits)) assert.ok((await client.jobs.result(jobId, { wait: true })).solved);
});

test("a batch sends a problem again that a full server refused", async () => {
  const seen: number[] = [];
  const full = await streamingStandIn("/marble.v1.Solver/SolveBatch", (call) => {
    call.on("data", (request: Buffer) => {
      const tag = request[1];
      const isFirst = !seen.includes(tag);
      seen.push(tag);
      const outcome = tag === 1 && isFirst ? field(3, refusal()) : field(2, solved());
      call.write(Buffer.concat([small(1, tag), outcome]));
    });
    call.on("end", () => call.end());
  });
  try {
    using client = connect(full.address);
    const tags: number[] = [];
    for await (const { tag, error } of client.batch(many(3))) {
      assert.equal(error, undefined);
      tags.push(tag);
    }
    assert.deepEqual(tags.sort(), [0, 1, 2]);
    assert.deepEqual(seen.sort(), [1, 1, 2, 3]);
  } finally {
    full.stop();
  }
});

test("reading an array waits while the server has too many readers", async () => {
  let calls = 0;
  const full = await streamingStandIn("/marble.v1.Jobs/ArrayResults", (call) => {
    const metadata = new Metadata();
    metadata.set("grpc-status-details-bin", refusal());
    if (calls++ === 0) return void call.emit("error", { code: status.RESOURCE_EXHAUSTED, details: "full", metadata });
    call.write(Buffer.concat([small(1, 1), small(2, 0), field(3, solved())]));
    call.end();
  });
  try {
    using client = connect(full.address);
    const sequences: number[] = [];
    for await (const { sequence } of client.jobs.array("any")) sequences.push(sequence);
    assert.deepEqual([calls, sequences], [2, [1]]);
  } finally {
    full.stop();
  }
});
