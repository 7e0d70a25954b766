import assert from "node:assert/strict";
import { createServer } from "node:net";

import { type Client, connect, type Session, UnavailableError } from "@marble/client";

import { corner, endless, example, long } from "./support/problems.js";
import { Relay } from "./support/relay.js";
import { eventually, Server } from "./support/server.js";
import { test } from "./support/test.js";

test("a client outlives a restart of its server", async () => {
  await using server = await Server.start();
  using client = connect(server.address);
  const before = await client.solve(corner);
  await server.restart();
  assert.deepEqual((await client.solve(corner)).z, before.z);
});

test("a call without a server is repeated until one is there", async () => {
  await using server = await Server.start();
  using client = connect(server.address);
  await client.info();
  await server.kill();
  const restarted = server.restart();
  await eventually(async () => {
    try {
      return (await client.solve(corner)).solved;
    } catch (error) {
      assert.ok(error instanceof UnavailableError);
      return false;
    }
  });
  await restarted;
});

test("a call that no server took is repeated, a deletion is not", async () => {
  let connections = 0;
  const hangingUp = createServer((socket) => {
    ++connections;
    socket.destroy();
  });
  await new Promise<void>((listening) => hangingUp.listen(0, "127.0.0.1", listening));
  const { port } = hangingUp.address() as { port: number };
  try {
    const attempts = async (call: (client: Client) => Promise<unknown>, waitMs?: number): Promise<number> => {
      connections = 0;
      using client = connect(`127.0.0.1:${port}`, { waitMs });
      await assert.rejects(call(client), UnavailableError);
      return connections;
    };
    const deleted = await attempts((client) => client.jobs.delete("x"), 1000);
    for (const call of [
      (client: Client) => client.solve(corner),
      (client: Client) => client.jobs.submit(corner),
      (client: Client) => client.session(corner),
    ]) {
      const repeated = await attempts(call, 1000);
      assert.ok(repeated > deleted, `${repeated} connections for ${call}, ${deleted} for a deletion`);
      const unrepeated = await attempts(call);  // gRPC may have connected again before the call failed
      assert.ok(unrepeated < repeated, `${unrepeated} connections without waiting, ${repeated} with it`);
    }
  } finally {
    hangingUp.close();
  }
});

test("a submission whose response was lost is repeated and is one job", async () => {
  await using server = await Server.start();
  using near = connect(server.address);
  using relay = await Relay.to(server.address);
  using far = connect(relay.address);
  const submitted = far.jobs.submit(example("hopper", "--steps", "10"));
  await eventually(async () => (await near.jobs.list()).jobs.length > 0);
  relay.cut();
  const { jobId } = await submitted;
  assert.deepEqual((await near.jobs.list()).jobs.map((job) => job.jobId), [jobId]);
  assert.ok((await near.jobs.result(jobId, { wait: true })).solved);
});

test("a streamed solve that has begun is not repeated after a loss", async () => {
  await using server = await Server.start();
  using client = connect(server.address);
  let accepted = 0;
  await assert.rejects(async () => {
    for await (const event of client.solveStream(long, { options: endless })) {
      if (event.type === "accepted") ++accepted;
      if (event.type === "progress") await server.kill();
    }
  }, UnavailableError);
  assert.equal(accepted, 1);
});

test("a draining server returns the best iterate of running solves and accepts no new ones", async () => {
  await using server = await Server.start(["--drain-grace-s", "1"]);
  using client = connect(server.address);
  using impatient = connect(server.address, { waitMs: 0 });
  let draining: Promise<void> | undefined;
  const refused = (error: unknown): boolean => error instanceof UnavailableError;
  const solution = await client.solve(long, {
    options: endless,
    onProgress: () => {
      if (draining !== undefined) return;
      server.signal("SIGTERM");
      draining = eventually(() => impatient.jobs.submit(corner).then(() => false, refused));
    },
  });
  assert.equal(solution.status, "cancelled");
  assert.equal(solution.z.length, long.g.length);
  await draining;
});

test("the default address is that of the environment", async () => {
  await using server = await Server.start();
  process.env["MARBLE_SERVER"] = server.address;
  try {
    using client = connect();
    assert.equal(client.address, server.address);
    assert.ok((await client.solve(corner)).solved);
  } finally {
    delete process.env["MARBLE_SERVER"];
  }
  assert.equal(connect().address, "127.0.0.1:50051");
});

test("the default name of a client is its program and process", async () => {
  await using server = await Server.start();
  using nameless = connect(server.address);
  assert.equal((await nameless.info()).client, `connection.test-${process.pid}`);
  process.env["MARBLE_CLIENT_NAME"] = "arm";
  try {
    using named = connect(server.address);
    assert.equal((await named.info()).client, "arm");
  } finally {
    delete process.env["MARBLE_CLIENT_NAME"];
  }
});

test("a unix socket works as an address", async () => {
  await using server = await Server.start(["--listen", "unix:{directory}/socket"]);
  using client = connect(`unix:${server.file("socket")}`);
  assert.ok((await client.solve(corner)).solved);
});

// More concurrent calls than one connection permits.
const room = ["--sessions", "6000", "--client-sessions", "6000", "--session-bytes", "16000000000"];

async function openAll(client: Client, count: number): Promise<Session[]> {
  return Promise.all(Array.from({ length: count }, () => client.session(corner)));
}

test("thousands of sessions work in one process, with solve and info beside them", async () => {
  await using server = await Server.start(room);
  using client = connect(server.address);
  const sessions = await openAll(client, 5000);
  assert.equal((await client.info()).counters.sessions, 5000);
  assert.ok((await client.solve(corner)).solved);
  const answers = await Promise.all(sessions.map((session) => session.update()));
  assert.ok(answers.every((answer) => answer.solved));
  await Promise.all(sessions.map((session) => session.close()));
  assert.equal((await client.info()).counters.sessions, 0);
});

test("no connection exceeds its limit of calls, and unused connections are closed", async () => {
  await using server = await Server.start([...room, "--connection-streams", "5"]);
  using relay = await Relay.to(server.address);
  relay.pass();
  using client = connect(relay.address, { connectionStreams: 4 });
  const sessions = await openAll(client, 10);
  assert.equal(relay.connections, 3);
  assert.ok((await client.solve(corner)).solved);
  assert.equal(relay.connections, 3);
  await Promise.all(sessions.map((session) => session.close()));
  await relay.until(() => relay.connections === 1);
  assert.ok((await client.solve(corner)).solved);
  assert.equal(relay.connections, 1);
});

test("connect refuses an invalid number of calls", () => {
  for (const connectionStreams of [0, -1, 1.5, NaN, 2 ** 31]) {
    const field = { name: "InvalidProblemError", field: "connectionStreams" };
    assert.throws(() => connect("127.0.0.1:1", { connectionStreams }), field);
  }
});
