// More concurrent calls than one connection permits.
import assert from "node:assert/strict";

import { type Client, type Session, connect } from "@marble/client";

import { corner } from "./support/problems.js";
import { Relay } from "./support/relay.js";
import { Server } from "./support/server.js";
import { test } from "./support/test.js";

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
