// Servers that disappear without closing their connections.
import assert from "node:assert/strict";

import { type ConnectOptions, type Session, UnavailableError, connect } from "@marble/client";

import { corner, endless, long } from "./support/problems.js";
import { Relay } from "./support/relay.js";
import { Server, eventually } from "./support/server.js";
import { test } from "./support/test.js";

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
