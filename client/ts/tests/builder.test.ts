import assert from "node:assert/strict";
import { after, before } from "node:test";

import { type Client, ProblemBuilder, connect } from "@marble/client";

import { Server } from "./support/server.js";
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

const near = (actual: number, expected: number): void => assert.ok(Math.abs(actual - expected) < 1e-6, `${actual}`);

test("the sign of a two-sided row's dual shows which limit is active", async () => {
  const solveBetween = async (target: number): Promise<{ z: Float64Array; rowDuals: Float64Array }> => {
    const builder = new ProblemBuilder(2).square(1, { terms: [[0, 1]], constant: -target }).square(1, 1);
    builder.row([[1, 1]], { lower: 0, upper: 0 });
    builder.row([[0, 2]], { lower: -2, upper: 4 });
    builder.row([[0, 1]], {});
    const problem = builder.build();
    return problem.report(await client.solve(problem));
  };
  const high = await solveBetween(5); // z0 = 2: gradient −3 = dual · 2
  near(high.z[0], 2);
  near(high.rowDuals[1], -1.5);
  const low = await solveBetween(-3);
  near(low.z[0], -1);
  near(low.rowDuals[1], 1);
  const free = await solveBetween(1);
  near(free.rowDuals[1], 0);
  assert.equal(free.rowDuals[2], 0);
});

test("equalities and bounds have the same sign of dual as rows", async () => {
  // ½(z0 − 3)² + ½(z1 − 3)² with z0 = 1, z1 ≤ 2
  const builder = new ProblemBuilder(2);
  for (const i of [0, 1]) builder.square(1, { terms: [[i, 1]], constant: -3 });
  builder.row([[0, 1]], { lower: 1, upper: 1 });
  builder.bound(1, { upper: 2 });
  const problem = builder.build();
  const { rowDuals, boundDuals, objective } = problem.report(await client.solve(problem));
  near(rowDuals[0], -2);
  near(boundDuals[1], -1);
  near(boundDuals[0], 0);
  near(objective, 2.5);
});

test("Qz + g is the sum of all duals times their rows", async () => {
  const builder = new ProblemBuilder(4, "balance");
  builder.quadratic(0, 0, 1).quadratic(0, 1, 0.5).quadratic(1, 1, 1).quadratic(2, 2, 1).quadratic(3, 3, 0.5);
  builder.linear(0, -3).linear(1, -1).linear(2, -2).linear(3, 1).constant(7);
  builder.row(
    [
      [0, 1],
      [1, 1],
      [2, 1],
    ],
    { lower: -1, upper: 1.5 },
  );
  builder.row(
    [
      [2, 1],
      [3, -1],
    ],
    { lower: 0.25, upper: 0.25 },
  );
  builder.bound(2, { lower: 0, upper: 0.5 });
  builder.pair(0, { terms: [[1, 1]], constant: 0.5 });
  builder.pair(1, 3);
  const problem = builder.build();
  const { z, rowDuals, boundDuals, pairs } = problem.report(await client.solve(problem));
  const gradient = [2 * z[0] + 0.5 * z[1] - 3, 0.5 * z[0] + 2 * z[1] - 1, 2 * z[2] - 2, z[3] + 1];
  const sum = Array.from(boundDuals);
  for (const i of [0, 1, 2]) sum[i] += rowDuals[0];
  sum[2] += rowDuals[1];
  sum[3] -= rowDuals[1];
  sum[0] += pairs[0].leftDual;
  sum[1] += pairs[0].rightDual + pairs[1].leftDual;
  sum[3] += pairs[1].rightDual;
  gradient.forEach((value, i) => near(sum[i], value));
  for (const { left, right } of pairs) near(Math.min(left, right), 0);
  near(pairs[0].right, z[1] + 0.5);
});

test("a built problem does not change when the builder does", () => {
  const builder = new ProblemBuilder(1);
  builder.row([[0, 1]], { lower: 0 });
  const problem = builder.build();
  builder.row([[0, 1]], { upper: 9 });
  builder.pair(0, 0);
  assert.deepEqual([problem.C.rows, problem.L.rows, problem.d.length], [1, 0, 1]);
});

test("a limit of 1e20 counts as none", () => {
  for (const none of [Infinity, 1e20, 1e30]) {
    const builder = new ProblemBuilder(1);
    builder.row([[0, 1]], { lower: -none, upper: 2 });
    builder.bound(0, { lower: 0, upper: none });
    const { A, d } = builder.build();
    assert.deepEqual([A.rows, Array.from(d)], [0, [2, 0]]);
  }
  assert.throws(() => new ProblemBuilder(1).row([[0, 1]], { lower: 1e20 }), { field: "rows[0].lower" });
});

test("invalid parts are errors that name row, term and rule", () => {
  const builder = new ProblemBuilder(2);
  builder.row([[0, 1]], { lower: 0 });
  const wrong: [() => unknown, object][] = [
    [
      () =>
        builder.row(
          [
            [0, 1],
            [2, 1],
          ],
          {},
        ),
      { field: "rows[1]", index: 1, value: "2" },
    ],
    [() => builder.row([[0, NaN]], {}), { field: "rows[1]", index: 0, value: "NaN" }],
    [() => builder.row([[0, 1]], { lower: 2, upper: 1 }), { field: "rows[1].lower", value: "2" }],
    [() => builder.row([[0, 1]], { lower: Infinity }), { field: "rows[1].lower", value: "Infinity" }],
    [() => builder.bound(0, { upper: NaN }), { field: "bounds[0].upper", value: "NaN" }],
    [() => builder.pair(0, -1), { field: "pairs[0].right", index: 0, value: "-1" }],
    [() => builder.pair(0, { terms: [], constant: NaN }), { field: "pairs[0].right.constant" }],
    [() => builder.linear(5, 1), { field: "linear" }],
    [() => builder.square(NaN, 0), { field: "square.weight" }],
    [() => new ProblemBuilder(0), { field: "n" }],
  ];
  for (const [piece, expected] of wrong) assert.throws(piece, { name: "InvalidProblemError", ...expected });
});
