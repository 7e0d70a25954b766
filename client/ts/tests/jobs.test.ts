import assert from "node:assert/strict";
import { after, before } from "node:test";

import { CancelledError, type Client, type JobEvent, NotFoundError, connect } from "@marble/client";

import { corner, endless, example, long } from "./support/problems.js";
import { Server, eventually } from "./support/server.js";
import { test } from "./support/test.js";

let server: Server;
let client: Client;

before(async () => {
  server = await Server.start(["--workers", "1"]);
  client = connect(server.address, { name: "planner" });
});

after(async () => {
  client.close();
  await server[Symbol.asyncDispose]();
});

test("a submitted job and its result outlive the client", async () => {
  const submitter = connect(server.address, { name: "planner" });
  const { jobId } = await submitter.jobs.submit(corner, { requestId: "tick 7" });
  submitter.close();
  const solution = await client.jobs.result(jobId, { wait: true });
  assert.equal(solution.jobId, jobId);
  assert.deepEqual(solution.z, (await client.solve(corner)).z);
});

test("a job has its sizes, options and convergence", async () => {
  const problem = example("rocket");
  const { jobId } = await client.jobs.submit(problem, { options: { numStarts: 2 }, requestId: "r-1", priority: "batch" });
  const solution = await client.jobs.result(jobId, { wait: true });
  const { job, options, trace } = await client.jobs.get(jobId);
  assert.deepEqual(
    [job.kind, job.state, job.priority, job.status, job.client, job.requestId, job.problemName],
    ["submitted", "finished", "batch", solution.status, "planner", "r-1", "rocket"],
  );
  assert.deepEqual([job.variables, job.pairs], [problem.g.length, problem.l.length]);
  assert.equal(options.numStarts, 2);
  assert.ok(trace.rows.length > 0 && trace.stride >= 1);
  const newest = trace.pairs.at(-1);
  assert.ok(newest?.s instanceof Float32Array);
  assert.deepEqual([newest.s.length, newest.t.length], [job.pairs, job.pairs]);
});

test("a job says why its problem is infeasible", async () => {
  const problem = { ...corner, A: [[1, 0, 0]], b: [-1], C: [[3, 0, 0]], d: [-6] }; // z0 = 1, and 3 z0 >= 6
  for (const explain of [false, true]) {
    const { jobId } = await client.jobs.submit(problem, { options: { explain } });
    const { status, certificate, conflict } = await client.jobs.result(jobId, { wait: true });
    const { infeasibility } = await client.jobs.get(jobId);
    assert.equal(status, "infeasible");
    assert.ok(infeasibility?.rows instanceof Int32Array);
    assert.deepEqual(Array.from(infeasibility.rows).sort(), [0, 1]);
    assert.deepEqual(infeasibility.multipliers, Float64Array.from(infeasibility.rows, (row) => certificate[row]));
    assert.deepEqual([infeasibility.moreRows, infeasibility.moreParts], [0, 0]);
    assert.deepEqual(infeasibility.conflict, conflict);
    assert.deepEqual(Array.from(infeasibility.conflict?.inequalities ?? []), explain ? [0] : []);
  }
  const { jobId } = await client.jobs.submit(corner);
  await client.jobs.result(jobId, { wait: true });
  assert.equal((await client.jobs.get(jobId)).infeasibility, undefined);
});

test("jobs are listed newest first, by state, in pages", async () => {
  const ids: string[] = [];
  for (let k = 0; k < 3; ++k) ids.push((await client.jobs.submit(corner)).jobId);
  for (const id of ids) await client.jobs.result(id, { wait: true });
  const first = await client.jobs.list({ states: ["finished"], limit: 2 });
  assert.deepEqual(
    first.jobs.map((job) => job.jobId),
    [ids[2], ids[1]],
  );
  assert.ok(first.more);
  const next = await client.jobs.list({ states: ["finished"], limit: 1, beforeJobId: ids[1] });
  assert.equal(next.jobs[0].jobId, ids[0]);
  await assert.rejects(client.jobs.list({ states: ["lost" as "idle"] }), {
    name: "InvalidProblemError",
    field: "states",
  });
});

test("a cancelled job returns its best iterate", async () => {
  const { jobId } = await client.jobs.submit(long, { options: endless });
  await eventually(async () => (await client.jobs.get(jobId)).job.iterations > 0);
  await client.jobs.cancel(jobId);
  const solution = await client.jobs.result(jobId, { wait: true });
  assert.equal(solution.status, "cancelled");
  assert.equal(solution.z.length, long.g.length);
});

test("a deleted job does not exist", async () => {
  const { jobId } = await client.jobs.submit(long, { options: endless });
  await client.jobs.delete(jobId);
  await assert.rejects(client.jobs.result(jobId), NotFoundError);
});

test("a signal ends the wait for a result, not the job", async () => {
  const { jobId } = await client.jobs.submit(long, { options: endless });
  const waiting = client.jobs.result(jobId, { wait: true, signal: AbortSignal.timeout(50) });
  await assert.rejects(waiting, CancelledError);
  await eventually(async () => (await client.jobs.get(jobId)).job.state === "running");
  await client.jobs.delete(jobId);
});

test("watching one job yields its rows until it has finished", async () => {
  const { jobId } = await client.jobs.submit(long, { options: endless });
  const events: JobEvent[] = [];
  let cancelled = false;
  for await (const event of client.jobs.watch(jobId)) {
    events.push(event);
    if (event.rows.length === 0 || cancelled) continue;
    cancelled = true;
    await client.jobs.cancel(jobId);
  }
  assert.ok(events[0].trace !== undefined);
  assert.equal(events.at(-1)?.job.state, "finished");
  assert.equal(events.at(-1)?.job.status, "cancelled");
});

test("watching all jobs continues until the loop is left or the signal aborts", async () => {
  const { jobId } = await client.jobs.submit(long, { options: endless });
  const ended = new Set<string>();
  let later = "";
  let watching = false;
  const seen = (async () => {
    for await (const { job } of client.jobs.watch()) {
      watching ||= job.jobId === jobId;
      if (job.state === "finished") ended.add(job.jobId);
      if (ended.has(later)) return;
    }
  })();
  await eventually(() => watching); // events before that are lost
  later = (await client.jobs.submit(corner)).jobId; // behind the first, on the one worker
  await client.jobs.cancel(jobId);
  await seen;
  assert.ok(ended.has(jobId));
  await assert.rejects(async () => {
    for await (const event of client.jobs.watch("", { signal: AbortSignal.timeout(100) })) assert.ok(event.job.jobId);
  }, CancelledError);
});

test("an array returns each result once, and reading can be resumed", async () => {
  const g = (k: number): number[] => Array.from(corner.g, (value) => value * (k + 1));
  const elements = Array.from({ length: 50 }, (_, k) => ({ update: { g: g(k) } }));
  const { jobId, elements: count } = await client.jobs.submitArray(elements, { base: corner, name: "fifty" });
  assert.equal(count, 50);
  const seen = new Map<number, number>();
  let last = 0;
  for await (const { index, sequence, solution } of client.jobs.array(jobId)) {
    assert.ok(solution !== undefined);
    seen.set(index, solution.objective);
    last = sequence;
    if (seen.size === 20) break;
  }
  for await (const { index, solution } of client.jobs.array(jobId, { after: last })) {
    assert.ok(solution !== undefined && !seen.has(index));
    seen.set(index, solution.objective);
  }
  assert.equal(seen.size, 50);
  assert.equal(seen.get(7), (await client.solve({ ...corner, g: g(7) })).objective);
  const { job } = await client.jobs.get(jobId);
  assert.deepEqual([job.kind, job.problemName], ["array", "fifty"]);
  assert.deepEqual(job.array, { elements: 50, done: 50, solved: 50, failed: 0 });
});

test("an error in an array names its element", async () => {
  await assert.rejects(client.jobs.submitArray([{ problem: corner }, { update: {} }]), { field: "elements[1].problem" });
  await assert.rejects(client.jobs.submitArray([{ update: { g: [1] } }], { base: corner }), { field: "elements[0].g" });
  await assert.rejects(client.jobs.array("nowhere").next(), NotFoundError);
});
