import assert from "node:assert/strict";
import { execFileSync, spawnSync } from "node:child_process";
import { cpSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before } from "node:test";

import { Server } from "./support/server.js";
import { test } from "./support/test.js";

// The code blocks of the README, in order.
const blocks = [...readFileSync("README.md", "utf8").matchAll(/^```(\w+)\n(.*?)^```$/gms)].map(([, kind, text]) => ({
  kind,
  text,
}));
const quickStart = blocks.slice(0, 5);

// A copy of the checkout as the README names it, and a project beside it.
let work: string;

before(() => {
  work = mkdtempSync(join(tmpdir(), "marble-ts-readme-"));
  const checkout = join(work, "marble");
  mkdirSync(join(work, "project"));
  const made = /(^|\/)(node_modules|dist|build|docs|generated|[^/]*\.tgz)$/;
  cpSync(".", join(checkout, "client/ts"), { recursive: true, filter: (path) => !made.test(path) });
  cpSync("../../proto", join(checkout, "proto"), { recursive: true, dereference: true });
  cpSync("../../LICENSE", join(checkout, "LICENSE"));
});

after(() => rmSync(work, { recursive: true, force: true }));

function shell(command: string, folder: string, env: NodeJS.ProcessEnv = {}): string {
  const options = { cwd: join(work, folder), encoding: "utf8", env: { ...process.env, ...env } } as const;
  return execFileSync("sh", ["-euc", command], { ...options, stdio: ["ignore", "pipe", "ignore"] });
}

const packed = (): string => execFileSync("npm", ["pack", "--dry-run", "--json", "--silent"], { encoding: "utf8" });

test("the README's quick start does word for word what it says", async () => {
  assert.deepEqual(
    quickStart.map((block) => block.kind),
    ["sh", "sh", "js", "sh", "text"],
  );
  const [make, install, program, run, output] = quickStart.map((block) => block.text);
  shell(make, "marble");
  shell(install, "project");
  writeFileSync(join(work, "project/first.mjs"), program);
  await using server = await Server.start();
  assert.equal(shell(run, "project", { MARBLE_SERVER: server.address }), output);
});

// What the README's examples take for granted.
const given = `
import { type Client, type Problem, ProblemBuilder, shiftByStage } from "@marble/client";
declare const client: Client, signal: AbortSignal, draw: (...shown: unknown[]) => void;
declare const problem: Problem, shop: Problem, left: Problem, right: Problem, long: Problem;
declare const problems: { tag: string; problem: Problem }[], studies: number[][];
declare const step: number[], lossByZ: number[], state: number[], g: number[], demands: number[];
declare const stageOfVariable: number[], horizon: number;
`;

test("the README's other examples fit the types of the client", () => {
  const examples = blocks.slice(5).filter((block) => block.kind === "js");
  assert.equal(examples.length, 2);
  const program = (text: string): string => `${given}export async function example() {\n${text}}\n`;
  examples.forEach(({ text }, k) => writeFileSync(`build/readme-${k}.mts`, program(text)));
  const files = examples.map((_, k) => `build/readme-${k}.mts`);
  const settings = "--noEmit --strict --skipLibCheck --module nodenext --target es2022 --lib es2022,esnext.disposable,dom";
  const checked = spawnSync("npx", ["tsc", ...settings.split(" "), ...files], { encoding: "utf8" });
  assert.equal(checked.stdout, "");
  assert.equal(checked.status, 0);
});

test("the package contains compiled code, types, README and LICENSE, and nothing else", () => {
  const [{ files, size }] = JSON.parse(packed()) as [{ files: { path: string }[]; size: number }];
  const paths = files.map((file) => file.path);
  for (const path of ["LICENSE", "README.md", "package.json", "dist/index.js", "dist/index.d.ts"]) {
    assert.ok(paths.includes(path), path);
  }
  const others = paths.filter((path) => !/^dist\/.*\.(js|d\.ts)$/.test(path) && path.startsWith("dist"));
  assert.deepEqual(others, []);
  assert.equal(paths.filter((path) => !path.startsWith("dist/")).length, 3);
  assert.ok(size < 200_000, `${size} bytes`);
});

test("the lock file names no registry", () => {
  assert.doesNotMatch(readFileSync("package-lock.json", "utf8"), /"resolved"/);
});

test("the API reference is made without a warning", () => {
  execFileSync("npm", ["run", "docs"], { stdio: "pipe" });
  assert.match(readFileSync("docs/classes/Client.html", "utf8"), /solveStream/);
});
