// Sessions whose server hangs: it is stopped by SIGSTOP, and goes on by SIGCONT.
import assert from "node:assert/strict";

import {
  CancelledError,
  connect,
  type ConnectOptions,
  DeadlineError,
  InvalidProblemError,
  type Session,
  UnavailableError,
} from "@marble/client";

import { corner, endless, long } from "./support/problems.js";
import { Relay } from "./support/relay.js";
import { eventually, Server } from "./support/server.js";
import { test } from "./support/test.js";

const soon = { deadlineMs: 20 };
const ample = { deadlineMs: 60_000 };

for (const reopen of [false, true]) {
  test(`an update returns while the server hangs, and the next one works once it goes on (reopen ${reopen})`, async () => {
    await using server = await Server.start();
    using client = connect(server.address);
    await using session = await client.session(corner, { reopen });
    const { objective } = await session.update({ c0: 0 }, ample);
    await server.stop();
    for (let k = 1; k <= 3; ++k) {
      session.prepare({ g: corner.g });
      const message = "the server did not answer within 120 ms, 100 ms after the deadline";
      await assert.rejects(session.update({ c0: k }, soon), { name: "DeadlineError", message });
      assert.ok(session.isOpen);
    }
    server.signal("SIGCONT");
    const answer = await session.update({}, ample);
    assert.ok(answer.solved && session.reopened === 0);
    assert.ok(Math.abs(answer.objective - objective - 3) < 1e-6); // late answers are discarded, their data kept
  });
}

test("a server that leaves 20 updates without an answer counts as lost", async () => {
  await using one = await Server.start();
  await using other = await Server.start();
  using client = connect(`${one.address},${other.address}`);
  await using session = await client.session(corner, { reopen: true, reopenMs: 60_000, answerGraceMs: 20 });
  const { objective } = await session.update({ c0: 0 }, ample);
  using direct = connect(one.address);
  const busy = (await direct.info()).counters.sessions > 0 ? one : other;
  await busy.stop();
  for (let k = 1; k <= 20; ++k) await assert.rejects(session.update({ c0: k }, soon), DeadlineError);
  await eventually(() => session.reopened === 1);
  const answer = await session.update({}, ample);
  assert.ok(Math.abs(answer.objective - objective - 20) < 1e-6);
  busy.signal("SIGCONT");
});

test("without reopen the session ends then, and closing waits for no silent server", async () => {
  await using server = await Server.start();
  using client = connect(server.address);
  const ending = await client.session(corner, { answerGraceMs: 0 });
  const closing = await client.session(corner);
  await server.stop();
  for (let k = 0; k < 20; ++k) await assert.rejects(ending.update({}, { deadlineMs: 1 }), DeadlineError);
  await eventually(() => !ending.isOpen);
  await assert.rejects(ending.update(), UnavailableError);
  await assert.rejects(closing.update({}, soon), DeadlineError);
  await closing.close();
  server.signal("SIGCONT");
});

test("closing waits for no silent server whose last update waited for an earlier one", async () => {
  await using server = await Server.start();
  using client = connect(server.address);
  const session = await client.session(corner);
  await server.stop();
  const earlier = session.update();
  await assert.rejects(session.update({}, soon), DeadlineError);
  await session.close();
  await assert.rejects(earlier, CancelledError); // not the end of a keepalive
  server.signal("SIGCONT");
});

test("a session refuses an invalid grace", async () => {
  using client = connect("127.0.0.1:1");
  for (const answerGraceMs of [-1, NaN, Infinity, 3_600_001, "long" as unknown as number]) {
    await assert.rejects(client.session(corner, { answerGraceMs }), (error) => {
      return error instanceof InvalidProblemError && error.field === "answerGraceMs";
    });
  }
});

// Servers that disappear without closing their connections.
// The server permits half of its two seconds.
const often = { timeMs: 1100, timeoutMs: 2000 };

test("a server that disappears silently is detected, and a session continues on the next", async () => {
  await using server = await Server.start(["--keepalive-s", "2"]);
  await using other = await Server.start(["--keepalive-s", "2"]);
  using relay = await Relay.to(server.address);
  relay.pass();
  using alone = connect(relay.address, { keepalive: often });
  const session = await alone.session(corner);
  using both = connect(`${relay.address},${other.address}`, { keepalive: often });
  using direct = connect(server.address);
  const sessions: Session[] = [];
  await eventually(async () => {
    sessions.push(await both.session(corner, { reopen: true }));
    return (await direct.info()).counters.sessions > 1; // both are known by now
  });
  relay.stall();
  await assert.rejects(session.update(), UnavailableError);
  const answers = await Promise.all(sessions.map((one) => one.update()));
  assert.ok(answers.every(({ solved }) => solved));
  assert.ok(sessions.some(({ reopened }) => reopened === 1));
  await Promise.all(sessions.map((one) => one.close()));
});

test("permitted pings keep an idle session open", async () => {
  await using server = await Server.start(["--keepalive-s", "2"]);
  using relay = await Relay.to(server.address);
  relay.pass();
  using client = connect(relay.address, { keepalive: often });
  await using session = await client.session(long, { options: endless });
  const controller = new AbortController();
  const answer = client.solve(long, { options: endless, signal: controller.signal });
  const begun = relay.pings;
  await relay.until(() => relay.pings >= begun + 5);
  assert.equal(relay.connections, 1);
  controller.abort();
  await assert.rejects(answer, { name: "CancelledError" });
  assert.ok(session.isOpen);
});

test("connect refuses an invalid keepalive", () => {
  for (const keepalive of ["control_loop", "default", { timeMs: 500, timeoutMs: 1 }] as const) {
    connect("127.0.0.1:1", { keepalive }).close();
  }
  const wrong: [unknown, string][] = [
    ["often", "keepalive"],
    ["toString", "keepalive"],
    [null, "keepalive"],
    [{}, "keepalive.timeMs"],
    [{ timeMs: 499, timeoutMs: 100 }, "keepalive.timeMs"],
    [{ timeMs: 1000, timeoutMs: 0 }, "keepalive.timeoutMs"],
    [{ timeMs: 1000, timeoutMs: Infinity }, "keepalive.timeoutMs"],
  ];
  for (const [keepalive, field] of wrong) {
    const options = { keepalive } as ConnectOptions;
    assert.throws(() => connect("127.0.0.1:1", options), { name: "InvalidProblemError", field });
  }
});
