import assert from "node:assert/strict";
import { after, before } from "node:test";

import {
  type CallControls,
  type Client,
  InvalidProblemError,
  PreconditionError,
  type Problem,
  type SolveControls,
  connect,
} from "@marble/client";

import { Server } from "./support/server.js";
import { test } from "./support/test.js";

let server: Server;
let client: Client;

// min (z0 - 1)² + (z1 - 1)² on the two half-axes.
const eye = [
  [2, 0],
  [0, 2],
];
const pair: Problem = { g: [-2, -2], Q: eye, L: [[1, 0]], R: [[0, 1]] };

before(async () => {
  server = await Server.start(["--workers", "1"]);
  client = connect(server.address);
});

after(async () => {
  client.close();
  await server[Symbol.asyncDispose]();
});

async function refused(call: () => Promise<unknown>, field: string): Promise<void> {
  await assert.rejects(call, (error) => error instanceof InvalidProblemError && error.field === field);
}

const detached = (): Float64Array => {
  const array = Float64Array.of(-2, -2);
  structuredClone(array.buffer, { transfer: [array.buffer] });
  return array;
};

test("Values other than arrays of numbers are refused: detached, of BigInt, of texts, with holes, not an array", async () => {
  const session = await client.session(pair);
  const wrong: unknown[] = [detached(), new BigInt64Array(2), ["1", "2"], [-2, , -2], { length: 2, 0: 1, 1: 1 }, null, 3];
  for (const g of [...wrong, new DataView(new ArrayBuffer(16)), [1n, 2n], [true, false], [Symbol("x"), 1]]) {
    await assert.rejects(client.solve({ ...pair, g } as Problem), InvalidProblemError);
    await refused(() => session.update({ g } as object), "g");
  }
  assert.ok((await session.update({})).solved);
  await session.close();
});

test("Every typed array of numbers is accepted, also in shared memory", async () => {
  const shared = new Float64Array(new SharedArrayBuffer(16)).fill(-2);
  for (const g of [shared, Int8Array.of(-2, -2), Float32Array.of(-2, -2), Object.freeze([-2, -2])]) {
    assert.ok((await client.solve({ ...pair, g })).solved);
  }
});

test("Every number is read once, so that the checked values are sent", async () => {
  let reads = 0;
  const changing = new Proxy([-2, -2], {
    get: (of, key) => (key === "0" && reads++ > 0 ? NaN : (Reflect.get(of, key) as unknown)),
  });
  assert.ok((await client.solve({ ...pair, g: changing })).solved);
  assert.equal(reads, 1);
});

test("Sizes beyond a message's limits are refused before memory is allocated", async () => {
  for (const rows of [2 ** 31 - 1, 2 ** 28, 2 ** 40, -1, 1.5, NaN, "1"]) {
    const triplets = { rows, cols: 2, i: [], j: [], v: [] };
    const compressed = { rows, columns: 2, columnPointers: [0, 0, 0], rowIndices: [], values: [] };
    for (const A of [triplets, compressed]) await refused(() => client.solve({ ...pair, A } as Problem), "A.rows");
  }
});

test("Objects with another prototype, or none, neither pollute nor break", async () => {
  const hostile = JSON.parse('{"__proto__": {"polluted": 1}, "constructor": {"prototype": {"polluted": 1}}}') as object;
  assert.ok((await client.solve({ ...hostile, ...pair })).solved);
  assert.ok((await client.solve(Object.assign(Object.create(null) as object, pair))).solved);
  for (const options of [hostile, { toString: 1 }, { hasOwnProperty: 1 }, "x", null, 5]) {
    await refused(() => client.solve(pair, { options } as SolveControls), "options");
  }
  for (const path of ["constructor", "__proto__", 99]) {
    await refused(() => client.solve(pair, { options: { path } } as unknown as SolveControls), "options.path");
  }
  assert.equal(({} as Record<string, unknown>)["polluted"], undefined);
});

test("A deadline beyond gRPC's range is none, and an invalid one is refused", async () => {
  for (const deadlineMs of [Infinity, 1e300, 2 ** 53]) {
    assert.ok((await client.solve(pair, { deadlineMs })).solved);
    const session = await client.session(pair);
    assert.ok((await session.update({}, { deadlineMs })).solved);
    await session.close();
  }
  for (const deadlineMs of ["5", NaN, 0, -1, {}, null]) {
    await refused(() => client.solve(pair, { deadlineMs } as CallControls), "deadlineMs");
  }
});

test("An invalid signal is refused before the call begins", async () => {
  for (const signal of ["x", {}, 5, { aborted: false }]) {
    const controls = { signal } as unknown as CallControls;
    await refused(() => client.solve(pair, controls), "signal");
    await refused(() => client.info(controls), "signal");
    await refused(() => client.session(pair, controls), "signal");
  }
});

test("Calls of a closed client and of a closed session are refused", async () => {
  const closing = connect(server.address);
  const session = await closing.session(pair);
  await session.close();
  await session.close();
  await assert.rejects(session.update({}), PreconditionError);
  closing.close();
  closing.close();
  const calls: (() => Promise<unknown>)[] = [
    () => closing.solve(pair),
    () => closing.info(),
    () => closing.session(pair),
    () => closing.jobs.list(),
    () => closing.jobs.submit(pair),
    () => closing.batch([pair] as never).next(),
    () => closing.solveStream(pair).next(),
  ];
  for (const call of calls) await assert.rejects(call, PreconditionError);
});

test("Concurrent updates of a session are solved one by one, and a callback may solve", async () => {
  const session = await client.session(pair);
  const answers = await Promise.all(Array.from({ length: 20 }, () => session.update({})));
  assert.ok(answers.every((answer) => answer.solved));
  await session.close();
  const inner: Promise<{ solved: boolean }>[] = [];
  await client.solve(pair, { onProgress: () => void inner.push(client.solve(pair)) });
  assert.ok(inner.length > 0 && (await Promise.all(inner)).every((answer) => answer.solved));
});
