// Sessions whose server hangs: it is stopped by SIGSTOP, and goes on by SIGCONT.
import assert from "node:assert/strict";

import { CancelledError, DeadlineError, InvalidProblemError, UnavailableError, connect } from "@marble/client";

import { corner } from "./support/problems.js";
import { Server, eventually } from "./support/server.js";
import { test } from "./support/test.js";

const soon = { deadlineMs: 20 };
const long = { deadlineMs: 60_000 };

for (const reopen of [false, true]) {
  test(`an update returns while the server hangs, and the next one works once it goes on (reopen ${reopen})`, async () => {
    await using server = await Server.start();
    using client = connect(server.address);
    await using session = await client.session(corner, { reopen });
    const { objective } = await session.update({ c0: 0 }, long);
    await server.stop();
    for (let k = 1; k <= 3; ++k) {
      session.prepare({ g: corner.g });
      const message = "the server did not answer within 120 ms, 100 ms after the deadline";
      await assert.rejects(session.update({ c0: k }, soon), { name: "DeadlineError", message });
      assert.ok(session.isOpen);
    }
    server.signal("SIGCONT");
    const answer = await session.update({}, long);
    assert.ok(answer.solved && session.reopened === 0);
    assert.ok(Math.abs(answer.objective - objective - 3) < 1e-6); // late answers are discarded, their data kept
  });
}

test("a server that leaves 20 updates without an answer counts as lost", async () => {
  await using one = await Server.start();
  await using other = await Server.start();
  using client = connect(`${one.address},${other.address}`);
  await using session = await client.session(corner, { reopen: true, reopenMs: 60_000, answerGraceMs: 20 });
  const { objective } = await session.update({ c0: 0 }, long);
  using direct = connect(one.address);
  const busy = (await direct.info()).counters.sessions > 0 ? one : other;
  await busy.stop();
  for (let k = 1; k <= 20; ++k) await assert.rejects(session.update({ c0: k }, soon), DeadlineError);
  await eventually(() => session.reopened === 1);
  const answer = await session.update({}, long);
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
