// One client, several servers.
import assert from "node:assert/strict";

import { type Client, connect } from "@marble/client";

import { corner, endless, long } from "./support/problems.js";
import { Server, type StandIn, eventually, standIn } from "./support/server.js";
import { test } from "./support/test.js";

const list = (...servers: Server[]): string => servers.map((server) => server.address).join(",");

async function answered(server: Server): Promise<number> {
  using client = connect(server.address);
  return (await client.info()).counters.answeredTotal;
}

async function solveAll(client: Client, count: number): Promise<void> {
  for (let k = 0; k < count; ++k) assert.ok((await client.solve(corner)).solved);
}

/** Solves until each server had a solve. */
async function solveUntilAllServe(client: Client, ...servers: Server[]): Promise<void> {
  const before = await Promise.all(servers.map(answered));
  await eventually(async () => {
    await solveAll(client, 1);
    const now = await Promise.all(servers.map(answered));
    return now.every((count, k) => count > before[k]);
  });
}

test("calls go in turn to the servers, also concurrent ones", async () => {
  await using one = await Server.start();
  await using other = await Server.start();
  using client = connect(list(one, other));
  await solveUntilAllServe(client, one, other);
  const before = [await answered(one), await answered(other)];
  await Promise.all(Array.from({ length: 20 }, () => solveAll(client, 1)));
  assert.deepEqual([await answered(one), await answered(other)], [before[0] + 10, before[1] + 10]);
});

test("no solve is lost with a killed server, which receives calls again after its restart", async () => {
  await using one = await Server.start();
  await using other = await Server.start();
  using client = connect(list(one, other));
  await solveUntilAllServe(client, one, other);
  await one.kill();
  await solveAll(client, 20);
  await one.restart();
  await solveUntilAllServe(client, one, other);
});

test("a draining server receives no calls and no submissions", async () => {
  await using draining = await Server.start(["--workers", "1", "--drain-grace-s", "3600"]);
  await using other = await Server.start();
  using client = connect(list(draining, other));
  await solveUntilAllServe(client, draining, other);
  using itsOwn = connect(draining.address);
  const gaveUp = new AbortController();
  const busy = itsOwn.solve(long, { options: endless, signal: gaveUp.signal }).catch(() => undefined);
  await eventually(async () => (await itsOwn.info()).counters.running === 1);
  draining.signal("SIGTERM");
  // The client learns it within a moment; until then a submission may be refused.
  let inARow = 0;
  await eventually(async () => {
    inARow = await client.jobs.submit(corner).then(
      () => inARow + 1,
      () => 0,
    );
    return inARow === 10;
  });
  for (let k = 0; k < 20; ++k) await client.jobs.submit(corner);
  await solveAll(client, 20);
  assert.equal((await itsOwn.info()).counters.running, 1);
  gaveUp.abort();
  await busy;
});

/** A server with an empty GetInfo and no health service. */
function withoutHealth(onCall: () => void): Promise<StandIn> {
  return standIn("/marble.v1.Server/GetInfo", (answer) => {
    onCall();
    answer(null, Buffer.alloc(0));
  });
}

test("servers without a health service count as healthy", async () => {
  const calls = [0, 0];
  const servers = await Promise.all(calls.map((_, k) => withoutHealth(() => ++calls[k])));
  try {
    using client = connect(servers.map(({ address }) => address).join(","));
    await eventually(async () => (await client.info()) !== undefined && Math.min(...calls) > 0);
    const before = [...calls];
    for (let k = 0; k < 10; ++k) await client.info();
    assert.deepEqual(calls, [before[0] + 5, before[1] + 5]);
  } finally {
    for (const { stop } of servers) stop();
  }
});

test("a name stands for all its addresses, and an unknown name does not affect the others", async () => {
  await using server = await Server.start();
  const port = server.address.split(":")[1];
  for (const address of [`dns:///localhost:${port}`, `localhost:${port}, ${server.address}`, `a..b:1,${server.address}`]) {
    using client = connect(address);
    assert.equal(client.address, address);
    await solveAll(client, 3);
  }
});

for (const address of ["127.0.0.1:1,", "127.0.0.1:1,localhost", "127.0.0.1:1,unix:/socket", "dns:///localhost", ","]) {
  test(`the addresses "${address}" are an error of connect`, () => {
    assert.throws(() => connect(address), { name: "InvalidProblemError", field: "address" });
  });
}
