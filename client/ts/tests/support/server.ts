import { type ChildProcess, execFileSync, spawn } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import type { Socket } from "node:net";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { setTimeout as sleep } from "node:timers/promises";

import {
  Server as GrpcServer,
  ServerCredentials,
  type ServerDuplexStream,
  type ServerUnaryCall,
  type UntypedHandleCall,
  type sendUnaryData,
} from "@grpc/grpc-js";

/** Where `marble` and `marble-server` are. */
const binaries = resolve(process.env["MARBLE_BIN"] ?? "../../build/release/bin");

/** A real marble-server on a free loopback port, for one test. */
export class Server {
  private constructor(
    private process: ChildProcess,
    readonly address: string,
    private readonly directory: string,
    private readonly flags: string[],
  ) {}

  /** Starts a server and waits until it answers. `flags` follow --listen 127.0.0.1:0 and --http none. */
  static async start(flags: string[] = [], files: Record<string, string> = {}): Promise<Server> {
    const directory = mkdtempSync(join(tmpdir(), "marble-ts-"));
    for (const [name, content] of Object.entries(files)) writeFileSync(join(directory, name), content);
    const placed = flags.map((flag) => flag.replace("{directory}", directory));
    const process = await launch(directory, "127.0.0.1:0", placed);
    return new Server(process, readFileSync(join(directory, "address"), "utf8").split("\n")[0], directory, placed);
  }

  /** The path of a file that was given to `start`. */
  file(name: string): string {
    return join(this.directory, name);
  }

  signal(signal: NodeJS.Signals): void {
    this.process.kill(signal);
  }

  /** Stops the server; returns when all of its threads have stopped: until then one may still answer. */
  async stop(): Promise<void> {
    this.process.kill("SIGSTOP");
    const tasks = `/proc/${String(this.process.pid)}/task`;
    const state = (task: string): string => readFileSync(`${tasks}/${task}/stat`, "utf8").split(") ").at(-1)?.[0] ?? "";
    await eventually(() => readdirSync(tasks).every((task) => state(task) === "T"));
  }

  /** Kills the server, like a crash. */
  async kill(): Promise<void> {
    if (this.process.exitCode !== null || this.process.signalCode !== null) return;
    const ended = new Promise((done) => this.process.once("exit", done));
    this.process.ref();
    this.process.kill("SIGKILL");
    await ended;
  }

  /** Starts the server again at the same address. */
  async restart(): Promise<void> {
    await this.kill();
    rmSync(this.file("address"), { force: true });
    this.process = await launch(this.directory, this.address, this.flags);
  }

  async [Symbol.asyncDispose](): Promise<void> {
    await this.kill();
    rmSync(this.directory, { recursive: true, force: true });
  }
}

async function launch(directory: string, listen: string, flags: string[]): Promise<ChildProcess> {
  const ready = join(directory, "address");
  const place = ["--address-file", ready, "--listen", listen, "--http", "none"];
  const server = spawn(join(binaries, "marble-server"), [...place, ...flags], { stdio: ["ignore", "pipe", "pipe"] });
  let log = "";
  server.stdout.on("data", (text) => (log += String(text)));
  server.stderr.on("data", (text) => (log += String(text)));
  await eventually(() => existsSync(ready) || server.exitCode !== null);
  if (server.exitCode !== null) throw new Error(`marble-server did not start: ${log}`);
  // Node 18 runs a file's last hook, which stops the server, when nothing else keeps the process alive.
  server.unref();
  for (const pipe of [server.stdout, server.stderr]) (pipe as Socket).unref();
  return server;
}

export type BytesCall = ServerDuplexStream<Buffer, Buffer>;

/** A substitute for a server. */
export interface StandIn {
  address: string;
  stop: () => void;
}

/** A server with one method, without health service; messages are bytes. */
export async function standIn(path: string, onCall: (answer: sendUnaryData<Buffer>) => void): Promise<StandIn> {
  return serve(path, false, (_call: ServerUnaryCall<Buffer, Buffer>, answer: sendUnaryData<Buffer>) => onCall(answer));
}

/** The same for a bidirectional method. */
export async function streamingStandIn(path: string, onCall: (call: BytesCall) => void): Promise<StandIn> {
  return serve(path, true, onCall);
}

async function serve(path: string, stream: boolean, method: UntypedHandleCall): Promise<StandIn> {
  const server = new GrpcServer();
  const bytes = (value: Buffer): Buffer => value;
  const codec = { requestSerialize: bytes, requestDeserialize: bytes, responseSerialize: bytes, responseDeserialize: bytes };
  server.addService({ method: { path, requestStream: stream, responseStream: stream, ...codec } }, { method });
  const port = await new Promise<number>((bound, failed) =>
    server.bindAsync("127.0.0.1:0", ServerCredentials.createInsecure(), (error, at) => (error ? failed(error) : bound(at))),
  );
  return { address: `127.0.0.1:${port}`, stop: () => server.forceShutdown() };
}

/** The output of `marble`. */
export function marble(...words: string[]): string {
  return execFileSync(join(binaries, "marble"), words, { encoding: "utf8", maxBuffer: 1 << 28 });
}

/** Waits until a condition holds; fails after a minute. */
export async function eventually(holds: () => boolean | Promise<boolean>): Promise<void> {
  for (let tries = 0; tries < 6000; ++tries) {
    if (await holds()) return;
    await sleep(10);
  }
  throw new Error("did not happen within a minute");
}

/** A new token of `marble-server --new-token`, and its line for --tokens. */
export function newToken(nameAndRoles: string): { secret: string; line: string } {
  const made = execFileSync(join(binaries, "marble-server"), ["--new-token", nameAndRoles], { encoding: "utf8" });
  const end = made.indexOf("\n");
  return { secret: made.slice(0, end), line: made.slice(end + 1) };
}
