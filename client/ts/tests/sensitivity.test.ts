// Derivatives of solutions compared with differences, in every call that solves.
import assert from "node:assert/strict";
import { after, before } from "node:test";

import {
  type Client,
  InvalidProblemError,
  type Problem,
  RefusedError,
  type SensitivityRequest,
  type Solution,
  connect,
} from "@marble/client";

import { Server } from "./support/server.js";
import { test } from "./support/test.js";

/** Three variables and a row of each kind: at the solution the inequality and one side of the pair are active. */
const problem: Problem = {
  Q: [
    [4, 1, 0],
    [1, 3, 1],
    [0, 1, 5],
  ],
  g: [-2, -2, -6],
  A: [[1, 1, 1]],
  b: [-2],
  C: [[0, 0, -1]],
  d: [0.9],
  L: [[1, 0, 0]],
  l: [-0.1],
  R: [[0, 1, 0]],
  r: [0.3],
};
const requested: SensitivityRequest = {
  directions: [{ b: [1] }, { d: [0.5], Q: { rows: 3, cols: 3, i: [0, 1], j: [1, 0], v: [1, 1] } }],
  losses: [{ z: [1, -2, 3] }, { equalityMultipliers: [1], inequalityMultipliers: [2] }],
  rows: { E: [[1, 0, 0], [0, 1, 0]], columns: true }, // prettier-ignore
};

let server: Server;
let client: Client;

before(async () => {
  server = await Server.start(["--sensitivity-directions", "4"]);
  client = connect(server.address);
});

after(async () => {
  client.close();
  await server[Symbol.asyncDispose]();
});

function close(found: ArrayLike<number>, expected: ArrayLike<number>, tolerance = 1e-5): void {
  assert.equal(found.length, expected.length);
  for (let k = 0; k < found.length; ++k) {
    assert.ok(Math.abs(found[k] - expected[k]) <= tolerance, `${found[k]} is not ${expected[k]}`);
  }
}

function derivativesOf(solution: Solution) {
  assert.ok(solution.solved && solution.sensitivity !== undefined);
  assert.equal(solution.sensitivity.error, undefined);
  return solution.sensitivity;
}

async function difference(
  change: (step: number) => Problem,
  of: (solution: Solution) => ArrayLike<number>,
): Promise<number[]> {
  const h = 1e-4;
  const [up, down] = [of(await client.solve(change(h))), of(await client.solve(change(-h)))];
  return Array.from(up, (value, k) => (value - down[k]) / (2 * h));
}

test("changes along directions are the differences of solutions nearby", async () => {
  const sensitivity = derivativesOf(await client.solve(problem, { sensitivity: requested }));
  assert.ok(sensitivity.smooth);
  const [along, other] = sensitivity.changes;
  assert.ok(along?.activeSetConstant && other?.activeSetConstant);
  const moved = (step: number): Problem => ({ ...problem, b: [-2 + step] });
  close(along.z, await difference(moved, ({ z }) => z));
  close(along.equalityMultipliers, await difference(moved, (s) => s.equalityMultipliers));
  close(along.complementarityMultipliersL, await difference(moved, (s) => s.complementarityMultipliersL));
  const bent = (step: number): Problem => {
    const Q = [[4, 1 + step, 0], [1 + step, 3, 1], [0, 1, 5]]; // prettier-ignore
    return { ...problem, d: [0.9 + step / 2], Q };
  };
  close(other.z, await difference(bent, ({ z }) => z));
  close(other.inequalityMultipliers, await difference(bent, (s) => s.inequalityMultipliers));
});

test("a gradient agrees with the change along each direction", async () => {
  const { changes, gradients } = derivativesOf(await client.solve(problem, { sensitivity: requested }));
  const [ofPoint, ofMultipliers] = gradients;
  assert.ok(ofPoint !== undefined && ofMultipliers !== undefined);
  assert.ok(changes[0] !== undefined && changes[1] !== undefined);
  const loss = ({ z }: { z: Float64Array }): number => z[0] - 2 * z[1] + 3 * z[2];
  close([ofPoint.b[0]], [loss(changes[0])], 1e-9);
  // Q's entries by columns: (0,0) (1,0) (0,1) …; upper ones represent both.
  close([0.5 * ofPoint.d[0] + ofPoint.Q[2]], [loss(changes[1])], 1e-9);
  assert.equal(ofPoint.Q[1], 0);
  assert.deepEqual([ofPoint.A.length, ofPoint.L.length, ofPoint.R.length], [3, 1, 1]);
  close([ofMultipliers.b[0]], [changes[0].equalityMultipliers[0] + 2 * changes[0].inequalityMultipliers[0]], 1e-9);
});

test("the response of rows to a multiplier is that of the solution", async () => {
  const { rows } = derivativesOf(await client.solve(problem, { sensitivity: requested }));
  assert.ok(rows !== undefined);
  const priced = (row: number) => (step: number) => {
    const g = [-2, -2, -6];
    g[row] += step;
    return { ...problem, g };
  };
  for (const row of [0, 1]) {
    const z = await difference(priced(row), (s) => s.z);
    close(rows.response[row], [-z[0], -z[1]]);
    close(rows.columns[row], z.map((value) => -value)); // prettier-ignore
  }
  assert.deepEqual(rows.values, rows.free);
});

test("every call that solves returns the same bits", async () => {
  const once = derivativesOf(await client.solve(problem, { sensitivity: requested }));
  const answers: Solution[] = [];
  for await (const event of client.solveStream(problem, { sensitivity: requested })) {
    if (event.type === "result") answers.push(event.solution);
  }
  for await (const { solution } of client.batch([{ tag: 1, problem, sensitivity: requested }])) {
    if (solution !== undefined) answers.push(solution);
  }
  const { jobId } = await client.jobs.submit(problem, { sensitivity: requested });
  answers.push(await client.jobs.result(jobId, { wait: true }));
  const session = await client.session(problem);
  answers.push(await session.update({}, { sensitivity: requested }));
  assert.equal((await session.update()).sensitivity, undefined);
  await session.close();
  assert.equal(answers.length, 4);
  for (const answer of answers) {
    assert.deepEqual(derivativesOf(answer).changes, once.changes);
    assert.deepEqual(derivativesOf(answer).gradients, once.gradients);
    assert.deepEqual(derivativesOf(answer).rows, once.rows);
  }
});

test("with a biactive pair each direction reports whether the active set is constant", async () => {
  const corner: Problem = { Q: [[2, 0], [0, 2]], g: [0, 0], L: [[1, 0]], R: [[0, 1]] }; // prettier-ignore
  const sensitivity = derivativesOf(
    await client.solve(corner, { sensitivity: { directions: [{ g: [-1, 1] }, { g: [1, -1] }] } }),
  );
  assert.deepEqual([...sensitivity.biactivePairs], [0]);
  assert.equal(sensitivity.smooth, false);
  assert.notEqual(sensitivity.changes[0]?.activeSetConstant, sensitivity.changes[1]?.activeSetConstant);
});

test("missing derivatives are undefined, and the error has the reason", async () => {
  const flat: Problem = { Q: [[2, 0], [0, 0]], g: [0, 0] }; // prettier-ignore
  const sensitivity = { directions: [{ g: [0, 1] }, { g: [1, 0] }], rows: { E: [[0, 1]] } };
  const answer = derivativesOf(await client.solve(flat, { sensitivity }));
  assert.equal(answer.changes[0], undefined);
  assert.ok(answer.changes[1] !== undefined);
  assert.match(answer.rowsError?.message ?? "", /flat/);
  const unsolved = await client.solve(problem, { sensitivity: requested, options: { maxIterations: 0 } });
  assert.equal(unsolved.sensitivity?.error?.code, "failed_precondition");
  assert.equal(unsolved.sensitivity?.smooth, false);
});

test("parts of wrong sizes are refused by name before they are sent", async () => {
  const refused = async (sensitivity: SensitivityRequest, message: RegExp): Promise<void> => {
    await assert.rejects(client.solve(problem, { sensitivity }), (error: unknown) => {
      assert.ok(error instanceof InvalidProblemError);
      assert.match(error.message, message);
      return true;
    });
  };
  await refused({ directions: [{}, { b: [1, 2] }] }, /^sensitivity\.directions\[1\]\.b = 2 entries: must have 1/);
  await refused({ losses: [{ z: [1] }] }, /^sensitivity\.losses\[0\]\.z = 1 entries/);
  await refused({ directions: [{ A: [[1, 1]] }] }, /^sensitivity\.directions\[0\]\.A\[0\] = 2 entries/);
  await refused({ rows: { E: [[1, 2]] } }, /^sensitivity\.rows\.E\[0\] = 2 entries/);
  await refused({ rows: { E: [[1, 2, 3]], proximal: [1, -1, 0] } }, /proximal\[1\] = -1\S*: must be >= 0/);
});

test("a request beyond the server's limit is refused by name", async () => {
  const losses = Array.from({ length: 5 }, () => ({ z: [1, 0, 0] }));
  await assert.rejects(client.solve(problem, { sensitivity: { losses } }), (error: unknown) => {
    assert.ok(error instanceof RefusedError);
    assert.equal(error.field, "sensitivity.losses.count");
    return true;
  });
});
