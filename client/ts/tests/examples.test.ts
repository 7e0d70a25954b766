import assert from "node:assert/strict";
import { execFile } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { after, before } from "node:test";
import { promisify } from "node:util";

import { Server, marble } from "./support/server.js";
import { test } from "./support/test.js";

let server: Server;

before(async () => {
  server = await Server.start();
  for (const name of ["hopper", "rocket"]) writeFileSync(server.file(`${name}.json`), marble("example", name));
});

after(() => server[Symbol.asyncDispose]());

async function run(example: string, ...words: string[]): Promise<string> {
  const env = { ...process.env, MARBLE_SERVER: server.address };
  return (await promisify(execFile)("node", [`build/examples/${example}.js`, ...words], { env })).stdout;
}

test("first-solve prints the solution of its problem", async () => {
  assert.match(await run("first-solve"), /^solved: objective 2,.*\nz = Float64Array\(3\)/);
});

test("progress prints one row per iteration and the solution", async () => {
  const lines = (await run("progress", server.file("rocket.json"))).trim().split("\n");
  assert.match(lines[0], /^job \S+, 0 before it$/);
  assert.ok(lines.length > 10);
  assert.match(lines.at(-1) ?? "", /^solved: /);
});

test("proof prints incumbent and bound, and what is proved", async () => {
  const lines = (await run("proof", server.file("rocket.json"), "2")).trim().split("\n");
  assert.match(lines.at(-1) ?? "", /^(solved|time_limit): -?[0-9.]+, (proved optimal|not proved, bound \S+, gap \S+)$/);
});

test("mpc follows the same closed loop as marble mpc", async () => {
  const printed = await run("mpc", server.file("hopper.json"), "5");
  const objectives = [...printed.matchAll(/objective (\S+)/g)].map(([, text]) => Number(text));
  const expected = marble("mpc", "hopper", "--control-steps", "5", "--output", "json", "--server", server.address)
    .trim()
    .split("\n")
    .map((line) => JSON.parse(line) as { objective?: number })
    .flatMap(({ objective }) => objective ?? []);
  assert.equal(objectives.length, 6);
  // Both round the numbers of a step differently, and from the second step on the branches of a plan may be as good.
  objectives.forEach((value, k) => assert.ok(Math.abs(value - expected[k]) < (k === 0 ? 1e-6 : 0.05) * expected[k]));
});

test("hopper draws a leg for every step, some of them on the ground", async () => {
  const picture = server.file("hopper.svg");
  assert.match(await run("hopper", server.file("hopper.json"), picture), /^solved: /);
  const svg = readFileSync(picture, "utf8");
  assert.match(svg, /^<svg xmlns="http:\/\/www.w3.org\/2000\/svg"/);
  assert.ok(!svg.includes("NaN"));
  assert.equal([...svg.matchAll(/<circle/g)].length, 120);
  const standing = [...svg.matchAll(/<polyline[^>]*#c0392b/g)].length;
  assert.ok(standing > 5 && standing < 60);
});
