import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { after, before } from "node:test";

import { type Client, type NonlinearProblem, type RealTime, UnavailableError, connect } from "@marble/client";

import { cost, moveOn, pendulum, shift } from "./support/pendulum.js";
import { type FileProblem, chain, endless, long } from "./support/problems.js";
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

const measured = { variables: [0, 1] };

test("of a plan that is an LCQP one tick is its answer, measured by a variable or by a row", async () => {
  const problem = chain(10);
  await using byRow = await client.realTime(functionsOf(problem), { equalities: [0] });
  const b = [-0.4, ...problem.b.slice(1)];
  const expected = await client.solve({ ...problem, b });
  const tick = await byRow.feedback([0.4]);
  assert.equal(tick.outcome, "answered");
  assert.equal(tick.why, "");
  assert.ok(tick.deadlineMet && tick.solution?.bStationary && tick.violation < 1e-8);
  near(tick.x, expected.z, 1e-6);
  near(tick.multipliers.equalities, expected.equalityMultipliers, 1e-5);
  near([tick.step], [Math.max(...tick.x.map(Math.abs))], 1e-12);
  assert.ok((await byRow.feedback([0.4])).step < 1e-6);

  await using byVariable = await client.realTime(functionsOf(problem), { variables: [3] });
  const [i, j, v] = [[...Array.from(problem.A.i), 10], [...Array.from(problem.A.j), 3], [...Array.from(problem.A.v), 1]];
  const A = { rows: 11, cols: problem.g.length, i, j, v };
  const fixed = await client.solve({ ...problem, A, b: [...problem.b, -0.3] });
  const other = await byVariable.feedback([0.3]);
  near(other.x, fixed.z, 1e-6);
  assert.equal(other.multipliers.equalities.length, 10);
});

test("one LCQP a tick follows a pendulum as well as plans that converge each tick", async () => {
  await using loop = await client.realTime(pendulum("gauss_newton"), { ...measured, shift });
  await using whole = await client.realTime(pendulum("gauss_newton"), measured);
  const once = await follow(async (state) => {
    loop.prepare();
    const tick = await loop.feedback(state);
    assert.equal(tick.outcome, "answered", tick.why);
    near(tick.x.subarray(0, 2), state, 1e-8);
    return tick.x[2];
  });
  const converged = await follow(async (state) => (await converge(whole, state))[2]);
  assert.ok(once.touched && converged.touched);
  assert.ok(once.cost <= 1.05 * converged.cost, `${once.cost} and ${converged.cost}`);
});

test("Hessian and residuals lead to the same plan", async () => {
  const state = [0.9, -1.5];
  await using squares = await client.realTime(pendulum("gauss_newton"), measured);
  await using exact = await client.realTime(pendulum("exact"), { ...measured, diagonal: 0.01 });
  near(await converge(exact, state), await converge(squares, state), 1e-6);
});

test("from tick to tick each stage takes the next one's place, the last one stays", async () => {
  const seen: Float64Array[] = [];
  const moved = (x: Float64Array): void => void seen.push(x.slice());
  await using loop = await client.realTime(pendulum("gauss_newton"), { ...measured, shift, moved });
  const { x } = await loop.feedback([0.5, -1]);
  loop.prepare();
  loop.prepare(); // no tick since
  assert.deepEqual(seen, [Float64Array.of(...x.slice(4), ...x.slice(-4))]);
});

test("a tick prepared before has the bits of one that was not", async () => {
  await using before = await client.realTime(pendulum("gauss_newton"), { ...measured, shift });
  await using at = await client.realTime(pendulum("gauss_newton"), { ...measured, shift });
  for (const state of [[0.5, -1], [0.4, -1.1], [0.3, -1.2]]) {
    before.prepare();
    assert.deepEqual((await before.feedback(state)).x, (await at.feedback(state)).x);
  }
});

test("a deadline that passes gives the plan moved on, or the last one, and says so", async () => {
  for (const [fallback, outcome, first] of [["shifted", "shifted", 1], ["keep", "kept", 0]] as const) {
    const moved = (x: Float64Array): void => void (x[0] += 1);
    const settings = { equalities: [0], options: endless, fallback, moved };
    await using loop = await client.realTime(functionsOf(long), settings);
    assert.equal((await loop.feedback([0], 20)).x[0], 0);
    const tick = await loop.feedback([0], 20);
    assert.equal(tick.outcome, outcome);
    assert.equal(tick.x[0], first);
    assert.match(tick.why, /^time_limit: |deadline/); // a solve that has begun is answered with its best point
  }
});

test("where the LCQP is infeasible its rows lack what they must, or the plan moves on", async () => {
  // (x − 1)²/2 + (y − x)²/2 with x ≤ 3, where 5 is measured.
  const wall: NonlinearProblem = {
    start: [1, 0],
    values: ([x, y]) => ({ objective: 0.5 * (x - 1) ** 2 + 0.5 * (y - x) ** 2, inequalities: [3 - x] }),
    derivatives: ([x, y]) => ({ gradient: [2 * x - 1 - y, y - x], inequalities: [[-1, 0]] }),
    hessian: () => [[2, -1], [-1, 1]],
  };
  const settings = { variables: [0] };
  await using moves = await client.realTime(wall, settings);
  const moved = await moves.feedback([5]);
  assert.equal(moved.outcome, "shifted");
  assert.match(moved.why, /^infeasible: /);
  assert.deepEqual([...moved.x], [1, 0]);
  near([moved.violation], [4], 1e-9);
  await using lacks = await client.realTime(wall, { ...settings, fallback: "elastic" });
  const tick = await lacks.feedback([5]);
  assert.equal(tick.outcome, "elastic");
  assert.match(tick.why, /^infeasible: /);
  near(tick.x, [2, 2], 1e-6); // of (x − 1)²/2 + |x − 5|, as a first weight is 1
  near([tick.violation], [3], 1e-6);
  const answered = await lacks.feedback([2.5]);
  assert.equal(answered.outcome, "answered");
  near(answered.x, [2.5, 2.5], 1e-6);
});

test("what functions give is held to its sizes and pattern, and named by function, part and row", async () => {
  const good = pendulum("gauss_newton");
  const refuses = (problem: Partial<NonlinearProblem>, fault: object, settings = {}): Promise<void> =>
    assert.rejects(client.realTime({ ...good, ...problem }, { ...measured, ...settings }), {
      name: "InvalidProblemError",
      ...fault,
    });
  const values = (changed: object): Partial<NonlinearProblem> => ({ values: (x) => ({ ...good.values(x), ...changed }) });
  const derivatives = (changed: object): Partial<NonlinearProblem> => ({
    derivatives: (x) => ({ ...good.derivatives(x), ...changed }),
  });
  await refuses({ start: [] }, { field: "start" });
  await refuses({ lower: [0] }, { field: "lower", value: "1 entries" });
  await refuses({ scale: new Array(50).fill(0) }, { field: "scale", index: 0, bound: "must be finite and > 0" });
  await refuses(values({ objective: NaN }), { field: "values.objective", value: "NaN" });
  await refuses(values({ equalities: [0, NaN] }), { field: "values.equalities", index: 1, value: "NaN" });
  await refuses(values({ H: [1] }), { field: "values.H", value: "1 entries" });
  await refuses(derivatives({ gradient: [1] }), { field: "derivatives.gradient" });
  await refuses(derivatives({ G: undefined }), { field: "derivatives.G" });
  const jacobian = { rows: 12, cols: 50, i: [3], j: [7], v: [Infinity] };
  const finite = "must be finite, in column 7 too";
  await refuses(derivatives({ H: jacobian }), { field: "derivatives.H", index: 3, bound: finite });
  await refuses(derivatives({ H: { ...jacobian, rows: 4, v: [1] } }), { field: "derivatives.H.rows", value: "4" });
  await refuses({}, { field: "variables", index: 1, value: "50" }, { variables: [0, 50] });
  await refuses({}, { field: "equalities", index: 1, bound: "must not be named twice" }, { equalities: [3, 3] });
  await refuses({}, { field: "shift.pairs[0].count" }, { shift: { pairs: [{ first: 0, count: 13, by: 1 }] } });
  await refuses({}, { field: "fallback" }, { fallback: "none" });
  await refuses({}, { field: "hessian" }, { curvature: "exact" });
  await refuses({ ...values({ residuals: [] }), ...derivatives({ residuals: undefined }) }, { field: "curvature" });
});

test("a fault within the loop leaves it open: of a measurement, of a pattern that changes, of two calls at once", async () => {
  let [column, value] = [0, 1];
  const line: NonlinearProblem = {
    start: [0, 0],
    values: (x) => ({ objective: 0, residuals: x, inequalities: [5 - x[0]] }),
    derivatives: () => ({
      gradient: [0, 0],
      residuals: [[1, 0], [0, 1]],
      inequalities: { rows: 1, columns: 2, columnPointers: [0, 1 - column, 1], rowIndices: [0], values: [-value] },
    }),
  };
  await using loop = await client.realTime(line, { variables: [1] });
  await assert.rejects(loop.feedback([1, 2]), { field: "measurement", value: "2 entries" });
  await assert.rejects(loop.feedback([NaN]), { field: "measurement", index: 0 });
  await assert.rejects(loop.feedback([1], 0), { field: "deadlineMs" });
  assert.throws(() => loop.restart([1]), { field: "x" });
  [column, value] = [1, 1];
  const bound = "must keep the pattern of the first point";
  assert.throws(() => loop.prepare(), { field: "derivatives.inequalities", value: "an entry at (0, 1)", bound });
  [column, value] = [0, NaN];
  assert.throws(() => loop.prepare(), { field: "derivatives.inequalities", index: 0 });
  [column, value] = [0, 1];
  const tick = loop.feedback([1]);
  assert.throws(() => loop.prepare(), { name: "PreconditionError" });
  near((await tick).x, [0, 1], 1e-6);
  loop.restart([3, 3]);
  near((await loop.feedback([2])).x, [0, 2], 1e-6);
});

test("a loop whose server is gone ends with UnavailableError", async () => {
  await using own = await Server.start();
  using planner = connect(own.address);
  const loop = await planner.realTime(functionsOf(long), { equalities: [0], options: endless });
  const tick = assert.rejects(loop.feedback([0]), UnavailableError);
  await own.kill();
  await tick;
  await assert.rejects(loop.feedback([0]), UnavailableError);
});

test("the README's boat arrives at the speed it says", () => {
  const readme = readFileSync("README.md", "utf8");
  const [, program, speed] = expected(/^```js\n(const \[h, stages\].*?)^```\n\nIt prints (\S+)\.\n/ms.exec(readme));
  const file = "build/boat.mjs";
  const begin = 'import { connect } from "@marble/client";\nconst client = connect();\n';
  writeFileSync(file, `${begin}${program}client.close();\n`);
  const env = { ...process.env, MARBLE_SERVER: server.address };
  assert.equal(execFileSync(process.execPath, [file], { encoding: "utf8", env }), `${speed}\n`);
});

function expected<T>(found: T | null): T {
  assert.ok(found !== null);
  return found;
}

/** Two pushes towards the stop; what the loop costs, and whether it got to the stop. */
async function follow(control: (state: number[]) => Promise<number>): Promise<{ cost: number; touched: boolean }> {
  let [state, sum, touched] = [[0.6, 0], 0, false];
  for (let k = 0; k < 40; ++k) {
    if (k % 15 === 5) state = [state[0], state[1] - 1.5];
    const u = await control(state);
    sum += cost(state, u);
    state = moveOn(state, u);
    touched ||= state[0] < -0.2 + 1e-9;
  }
  return { cost: sum, touched };
}

async function converge(loop: RealTime, state: number[]): Promise<Float64Array> {
  for (let k = 0; k < 100; ++k) {
    const tick = await loop.feedback(state);
    assert.equal(tick.outcome, "answered", tick.why);
    if (tick.step < 1e-8) return tick.x;
  }
  throw new Error("did not converge");
}

function functionsOf(problem: FileProblem): NonlinearProblem {
  const { Q, A, C, L, R, g, b, d, l, r } = problem;
  const times = (matrix: typeof Q, x: Float64Array, offset: number[]): number[] => {
    const sum = offset.slice();
    for (let k = 0; k < matrix.v.length; ++k) sum[matrix.i[k]] += matrix.v[k] * x[matrix.j[k]];
    return sum;
  };
  return {
    start: new Float64Array(g.length),
    values: (x) => ({
      objective: times(Q, x, g).reduce((sum, slope, j) => sum + 0.5 * (slope + g[j]) * x[j], 0),
      equalities: times(A, x, b),
      inequalities: times(C, x, d),
      G: times(L, x, l),
      H: times(R, x, r),
    }),
    derivatives: (x) => ({ gradient: times(Q, x, g), equalities: A, inequalities: C, G: L, H: R }),
    hessian: () => Q,
  };
}

function near(given: ArrayLike<number>, expected: ArrayLike<number>, tolerance: number): void {
  assert.equal(given.length, expected.length);
  const far = Array.from(given).findIndex((value, k) => !(Math.abs(value - expected[k]) <= tolerance));
  assert.equal(far, -1, `${given[far]} at ${far} instead of ${expected[far]}`);
}

test("with reopen the loop goes on where its server is lost, and falls back while there is none", async () => {
  await using own = await Server.start();
  using caller = connect(own.address);
  let told = 0;
  const settings = { ...measured, shift, reopen: true, reopenMs: 60_000, onReopen: () => void ++told };
  await using loop = await caller.realTime(pendulum("gauss_newton"), settings);
  await using beside = await client.realTime(pendulum("gauss_newton"), { ...measured, shift });
  const states = [[0.5, -1], [0.4, -1.1], [0.3, -1.2]];
  assert.equal((await loop.feedback(states[0])).outcome, "answered");
  await beside.feedback(states[0]);

  loop.prepare();
  await own.restart();
  const after = await loop.feedback(states[1]);
  assert.equal(after.outcome, "answered", after.why);
  near(after.x, (await beside.feedback(states[1])).x, 1e-5);
  assert.deepEqual([loop.reopened, told], [1, 1]);

  await own.kill();
  const without = await loop.feedback(states[2], 30);
  assert.deepEqual([without.outcome, without.deadlineMet], ["shifted", false]);
  assert.match(without.why, /the deadline passed while the server was lost/);
  loop.prepare();
  assert.equal((await loop.feedback(states[2], 30)).outcome, "shifted");
  await own.restart();
  const back = await loop.feedback(states[2]);
  assert.equal(back.outcome, "answered", back.why);
  near(back.x.subarray(0, 2), states[2], 1e-8);
  assert.deepEqual([loop.reopened, told], [2, 2]);
});
