import assert from "node:assert/strict";
import { after, before } from "node:test";

import { BinaryWriter } from "@bufbuild/protobuf/wire";
import { Metadata, status } from "@grpc/grpc-js";
import {
  type Client,
  type Counters,
  InvalidProblemError,
  MarbleError,
  NotFoundError,
  PreconditionError,
  type Problem,
  RefusedError,
  type SolveControls,
  UnavailableError,
  connect,
} from "@marble/client";

import { corner, endless, long } from "./support/problems.js";
import { Server, eventually, standIn } from "./support/server.js";
import { test } from "./support/test.js";

let server: Server;
let client: Client;

before(async () => {
  server = await Server.start(["--workers", "1", "--queue-jobs", "1"]);
  client = connect(server.address);
});

after(async () => {
  client.close();
  await server[Symbol.asyncDispose]();
});

interface Fault {
  what: string;
  problem: unknown;
  field: string;
  index?: number;
  value?: string;
}

const eye = { rows: 3, columns: 3, columnPointers: [0, 1, 2, 3], rowIndices: [0, 1, 2], values: [1, 1, 1] };

// Each violates one rule of an otherwise valid problem.
const faults: Fault[] = [
  { what: "no gradient", problem: { ...corner, g: [] }, field: "g", value: "0 entries" },
  { what: "a NaN in g", problem: { ...corner, g: [0, NaN, 0] }, field: "g", index: 1, value: "NaN" },
  { what: "text for g", problem: { ...corner, g: "abc" }, field: "g", value: "abc" },
  { what: "an infinite constant", problem: { ...corner, c0: Infinity }, field: "c0", value: "Infinity" },
  { what: "a short dense row", problem: { ...corner, C: [[1, 2]] }, field: "C[0]", value: "2 entries" },
  { what: "a NaN in a dense row", problem: { ...corner, C: [[1, 2, NaN]] }, field: "C[0]", index: 2, value: "NaN" },
  { what: "a short offset", problem: { ...corner, d: [1, 2] }, field: "d", value: "2 entries" },
  { what: "an offset without its matrix", problem: { ...corner, b: [1] }, field: "b", value: "1 entries" },
  {
    what: "a triplet beyond the columns",
    problem: { ...corner, A: { rows: 1, cols: 3, i: [0, 0], j: [0, 3], v: [1, 1] } },
    field: "A.j",
    index: 1,
    value: "3",
  },
  {
    what: "a triplet without its row",
    problem: { ...corner, A: { rows: 1, cols: 3, i: [0], j: [0, 1], v: [1, 1] } },
    field: "A.i",
    value: "1 entries",
  },
  {
    what: "a matrix of other columns",
    problem: { ...corner, A: { rows: 1, cols: 4, i: [], j: [], v: [] } },
    field: "A.cols",
    value: "4",
  },
  {
    what: "falling column pointers",
    problem: { ...corner, Q: { ...eye, columnPointers: [0, 2, 1, 3] } },
    field: "Q.columnPointers",
    index: 2,
    value: "1",
  },
  {
    what: "an infinite entry of compressed columns",
    problem: { ...corner, Q: { ...eye, values: [1, Infinity, 1] } },
    field: "Q.values",
    index: 1,
    value: "Infinity",
  },
  {
    what: "a row index beyond the rows",
    problem: { ...corner, Q: { ...eye, rowIndices: [0, 1, 3] } },
    field: "Q.rowIndices",
    index: 2,
    value: "3",
  },
  {
    what: "rows that do not ascend",
    problem: { ...corner, Q: { ...eye, columnPointers: [0, 0, 0, 3], rowIndices: [1, 0, 2] } },
    field: "Q.rowIndices",
    index: 1,
    value: "0",
  },
  {
    what: "an asymmetric Q",
    problem: {
      ...corner,
      Q: [
        [1, 1, 0],
        [0, 1, 0],
        [0, 0, 1],
      ],
    },
    field: "Q",
    value: "0 and 1",
  },
  {
    what: "a full Q said to be its upper triangle",
    problem: {
      ...corner,
      Q: [
        [1, 1, 0],
        [1, 1, 0],
        [0, 0, 1],
      ],
      hessianForm: "upper_triangle",
    },
    field: "Q",
    value: "an entry at (1, 0)",
  },
  { what: "pairs with one side", problem: { ...corner, R: undefined, r: undefined }, field: "R.rows", value: "0" },
  { what: "a short x0", problem: { ...corner, x0: [1] }, field: "initialPoint", value: "1 entries" },
];

for (const { what, problem, field, index, value } of faults) {
  test(`${what} is refused before anything is sent, with ${field}${index === undefined ? "" : ` and index ${index}`}`, async () => {
    const { counters } = await client.info();
    await assert.rejects(client.solve(problem as Problem), (error) => {
      assert.ok(error instanceof InvalidProblemError && error instanceof MarbleError);
      assert.deepEqual([error.code, error.field, error.index, error.value], ["invalid_argument", field, index, value]);
      assert.ok(error.bound && error.message.includes(error.bound) && error.message.includes(field));
      return true;
    });
    const { refusedTotal, acceptedTotal } = (await client.info()).counters;
    assert.deepEqual([refusedTotal, acceptedTotal], [counters.refusedTotal, counters.acceptedTotal]);
  });
}

test("a Q that is symmetric up to rounding is accepted by client and server", async () => {
  for (const q of [
    [4, 0, 1e-17, 0, 2, 0, 0, 0, 3],
    [4, 0, 0, 1e-17, 2, 0, -1e-17, 0, 3],
  ]) {
    const answer = await client.solve({ g: [-4, -2, -3], Q: [q.slice(0, 3), q.slice(3, 6), q.slice(6)] });
    assert.equal(answer.status, "solved");
    for (const value of answer.z) assert.ok(Math.abs(value - 1) < 1e-9);
  }
  // The tolerance is independent of other variables' sizes.
  const q = [
    [4, 0, 1e-6],
    [0, 1e20, 0],
    [0, 0, 3],
  ];
  await assert.rejects(client.solve({ g: [0, 0, 0], Q: q }), { name: "InvalidProblemError", field: "Q" });
});

const wrongControls: [unknown, string][] = [
  [{ options: { maxIterations: 1.5 } }, "options.maxIterations"],
  [{ options: { polish: 1 } }, "options.polish"],
  [{ options: { path: "quick" } }, "options.path"],
  [{ options: { method: "guess" } }, "options.method"],
  [{ options: { retraction: "linear" } }, "options.retraction"],
  [{ options: { timeLimit: 1 } }, "options"],
  [{ priority: "high" }, "priority"],
  [{ deadlineMs: 0 }, "deadlineMs"],
  [{ iterateEvery: -1, onProgress: () => undefined }, "iterateEvery"],
];

for (const [controls, field] of wrongControls) {
  test(`a wrong ${field} is an error that names it`, async () => {
    await assert.rejects(client.solve(corner, controls as SolveControls), { name: "InvalidProblemError", field });
  });
}

test("errors of the server's checks use the caller's names", async () => {
  await assert.rejects(client.solve(corner, { options: { equalityTolerance: 2 } }), (error) => {
    assert.ok(error instanceof InvalidProblemError);
    assert.equal(error.field, "options.equalityTolerance");
    assert.equal(error.value, "2");
    assert.match(error.bound ?? "", /must be in \[1e-14, 1/);
    return true;
  });
  for (const [options, field] of [
    [{ relativeGapTolerance: 1 }, "options.relativeGapTolerance"],
    [{ relativeGapTolerance: Number.NaN }, "options.relativeGapTolerance"],
    [{ nodeLimit: 0 }, "options.nodeLimit"],
  ] as const) {
    await assert.rejects(client.solve(corner, { options }), { name: "InvalidProblemError", field });
  }
  await assert.rejects(client.solve(corner, { requestId: "ä" }), { name: "InvalidProblemError", field: "requestId" });
});

test("a full queue is a RefusedError with a time to retry", async () => {
  const controller = new AbortController();
  const counters = async (): Promise<Counters> => (await client.info()).counters;
  const solve = (): Promise<unknown> => {
    const solved = client.solve(long, { options: endless, signal: controller.signal });
    solved.catch(() => undefined);
    return solved;
  };
  try {
    const running = solve();
    await eventually(async () => (await counters()).running === 1);
    const waiting = solve();
    await eventually(async () => (await counters()).queued === 1);
    await assert.rejects(client.solve(corner), (error) => {
      assert.ok(error instanceof RefusedError);
      assert.equal(error.code, "resource_exhausted");
      return error.retryAfterMs !== undefined && error.retryAfterMs > 0;
    });
    controller.abort();
    await Promise.allSettled([running, waiting]);
  } finally {
    controller.abort();
  }
});

// A protobuf message with strings and messages.
function message(...fields: [number: number, value: string | Uint8Array][]): Uint8Array {
  const writer = new BinaryWriter();
  for (const [number, value] of fields) writer.tag(number, 2).bytes(typeof value === "string" ? Buffer.from(value) : value);
  return writer.finish();
}

/** The error of a solve that is refused with these details: names of messages and their bytes. */
async function refused(...details: [name: string, bytes: Uint8Array][]): Promise<MarbleError> {
  const metadata = new Metadata();
  const packed = details.map(([name, bytes]): [number, Uint8Array] => [
    3,
    message([1, `type.googleapis.com/${name}`], [2, bytes]),
  ]);
  metadata.set("grpc-status-details-bin", Buffer.from(message(...packed)));
  const older = await standIn("/marble.v1.Solver/Solve", (answer) =>
    answer({ code: status.INVALID_ARGUMENT, details: "in words", metadata }),
  );
  try {
    using caller = connect(older.address);
    return await caller.solve(corner).then(
      () => assert.fail("it was to be refused"),
      (error: unknown) => {
        assert.ok(error instanceof MarbleError, String(error));
        return error;
      },
    );
  } finally {
    older.stop();
  }
}

const badRequest = (path: string): [string, Uint8Array] => [
  "google.rpc.BadRequest",
  message([1, message([1, path], [2, "is nan, must be finite"])]),
];

const places: [path: string, field: string, index?: number][] = [
  ["problem.gradient[3]", "g", 3],
  ["solve.problem.equality_matrix.values[7]", "A.values", 7],
  ["update.problem.hessian_values[2]", "Q.values", 2],
  ["setup.options.max_iterations", "options.maxIterations"],
  ["initial_point.z[1]", "initialPoint", 1],
  ["update.shift.pairs[2].by", "shift.pairs[2].by"],
  ["solve.coupled.blocks[12].problem.left_matrix.row_indices[3]", "coupled.blocks[12].problem.L.rowIndices", 3],
  ["coupled.blocks[1].coupling.rows", "coupled.blocks[1].coupling.rows"],
];

for (const [path, field, index] of places) {
  test(`an older server's error at ${path} has its place in the caller's terms, and the server's words`, async () => {
    const error = await refused(badRequest(path));
    assert.ok(error instanceof InvalidProblemError);
    assert.deepEqual([error.field, error.index, error.value], [field, index, undefined]);
    assert.equal(error.bound, "is nan, must be finite");
  });
}

test("the structured detail takes precedence over prose", async () => {
  const fault = message([1, "problem.gradient"], [3, "is this, or that"], [4, "must be, well, finite"]);
  const error = await refused(badRequest("b[1]"), ["marble.v1.Fault", fault]);
  assert.deepEqual([error.field, error.value, error.bound], ["g", "is this, or that", "must be, well, finite"]);
});

test("an error without details has its code and message", async () => {
  const error = await refused();
  assert.equal(error.code, "invalid_argument");
  assert.equal(error.field, undefined);
  assert.match(error.message, /in words/);
});

test("an unknown job is a NotFoundError, an unfinished one a PreconditionError", async () => {
  await assert.rejects(client.jobs.get("job-that-never-was"), NotFoundError);
  const { jobId } = await client.jobs.submit(long, { options: endless });
  await assert.rejects(client.jobs.result(jobId), PreconditionError);
  await client.jobs.delete(jobId);
});

test("an unknown option is refused with similar names, or with all of them", async () => {
  const unknown = (options: object) => client.solve(corner, { options });
  await assert.rejects(unknown({ timeLimit: 1 }), { field: "options", value: "timeLimit", bound: "must be one of timeLimitS" });
  await assert.rejects(unknown({ zzz: 1 }), { field: "options", bound: /^must be one of maxIterations, timeLimitS, / });
});

test("an unreachable server is an UnavailableError", async () => {
  using unreachable = connect("127.0.0.1:1");
  await assert.rejects(unreachable.solve(corner), (error) => {
    assert.ok(error instanceof UnavailableError);
    assert.match(error.message, /ECONNREFUSED 127\.0\.0\.1:1$/);
    return true;
  });
});

for (const address of ["", "localhost", "localhost:0", "localhost:65536", ":50051", "unix:"]) {
  test(`the address "${address}" is an error of connect`, () => {
    assert.throws(() => connect(address), { name: "InvalidProblemError", field: "address" });
  });
}
