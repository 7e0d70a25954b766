import { readFileSync } from "node:fs";
import { basename } from "node:path";

import { invalid } from "../errors.js";
import * as tables from "../shared/tables.js";

/** How a client reaches its server and identifies itself. All fields are optional. */
export interface ConnectOptions {
  /** Sent with every call, also without encryption. Printable ASCII without spaces. Default: `MARBLE_TOKEN`. */
  token?: string;
  /** Enables TLS; `true` trusts Node's certificate authorities. Default: enabled if a `MARBLE_TLS_` variable is set. */
  tls?: boolean | TlsOptions;
  /**
   * The client's name, for servers that do not authenticate clients; at most 64 printable characters. Default:
   * `MARBLE_CLIENT_NAME`, else the program's name with its process id, so that two planners on one host take turns.
   */
  name?: string;
  /** Deadline of calls without their own, in milliseconds > 0; not of batches, sessions and watching. Default: none. */
  deadlineMs?: number;
  /**
   * When a server that disappears without closing the connection counts as lost: `default` after at most 45 s,
   * `control_loop` after 13 s, the least that a server permits by default, or custom times. Default: `default`.
   */
  keepalive?: "default" | "control_loop" | Keepalive;
  /**
   * How long a call waits for a lost server, in milliseconds >= 0 from the loss, within its own deadline. Calls that
   * are safe to repeat, the set-up of a session and the unsolved problems of a batch are tried again every 0.1 to 1 s.
   * Default: 10,000 once a server was reached, else 0, so that a wrong address is reported at once.
   */
  waitMs?: number;
  /**
   * Concurrent calls per connection, in [1, 2^31); default 900. A session and a batch are one call each. The client
   * opens another connection for more. Keep it below the server's `--connection-streams`, 1024 by default: gRPC
   * silently holds back further calls.
   */
  connectionStreams?: number;
}

/** Pings while calls are active: a server that does not answer a ping is lost. */
export interface Keepalive {
  /**
   * Idle time before a ping, in whole milliseconds in [500, 2^31). At least half of the server's `--keepalive-s`, by
   * default 10,000 ms: it closes the connections of clients that ping more often.
   */
  timeMs: number;
  /** Timeout of a ping's answer, in whole milliseconds in [1, 2^31). */
  timeoutMs: number;
}

/** PEM files, which `connect` reads once. */
export interface TlsOptions {
  /** Trusted certificate authorities. Default: `MARBLE_TLS_CA`, else Node's. */
  ca?: string;
  /** The client's certificate; requires `key`. Default: `MARBLE_TLS_CERTIFICATE`. */
  certificate?: string;
  /** The private key of `certificate`. Default: `MARBLE_TLS_KEY`. */
  key?: string;
  /** The name in the server's certificate, if it differs from the host of the address. */
  serverName?: string;
}

/** Contents of PEM files. */
export interface Pems {
  ca?: Buffer;
  certificate?: Buffer;
  key?: Buffer;
  serverName?: string;
}

/** The client's identity, from the options or else the environment. */
export interface Identity {
  token?: string;
  name: string;
  /** Absent without TLS. */
  tls?: Pems;
}

export function defaultAddress(): string {
  return environment("MARBLE_SERVER") ?? tables.defaultAddress;
}

export function identityOf(options: ConnectOptions): Identity {
  const token = options.token ?? environment("MARBLE_TOKEN");
  if (token !== undefined && !/^[!-~]+$/.test(token)) {
    throw invalid("token", "must be printable ASCII without spaces"); // not quoted: it is secret
  }
  const name = options.name ?? environment("MARBLE_CLIENT_NAME") ?? processName();
  if (!/^[ -~]+$/.test(name) || name.length > tables.longestClientName) {
    throw invalid("name", `must be 1 to ${tables.longestClientName} bytes of printable ASCII`, { value: name });
  }
  return { token, name, tls: pemsOf(options.tls) };
}

export function checkStreams(streams = 900): number {
  if (Number.isInteger(streams) && streams >= 1 && streams <= 0x7fffffff) return streams;
  throw invalid("connectionStreams", "must be a whole number in [1, 2^31)", { value: streams });
}

// The server permits one ping per 10 s by its own clock, so the margin covers a delayed ping followed by a punctual
// one.
const keepalives: Record<string, Keepalive> = {
  default: { timeMs: 30_000, timeoutMs: 15_000 },
  control_loop: { timeMs: 11_000, timeoutMs: 2_000 },
};

export function keepaliveOf(given: ConnectOptions["keepalive"] = "default"): Keepalive {
  const times = typeof given === "object" ? given : Object.hasOwn(keepalives, given) ? keepalives[given] : undefined;
  if (times === undefined || times === null) {
    throw invalid("keepalive", "must be default, control_loop or {timeMs, timeoutMs}", { value: given });
  }
  for (const [name, least] of [["timeMs", 500], ["timeoutMs", 1]] as const) {
    const value = times[name];
    if (Number.isInteger(value) && value >= least && value <= 0x7fffffff) continue;
    throw invalid(`keepalive.${name}`, `must be a whole number in [${least}, 2^31)`, { value });
  }
  return times;
}

export function checkWait(waitMs: number | undefined): number | undefined {
  if (waitMs === undefined || (typeof waitMs === "number" && waitMs >= 0)) return waitMs;
  throw invalid("waitMs", "must be >= 0", { value: waitMs });
}

function pemsOf(tls: boolean | TlsOptions | undefined): Pems | undefined {
  const given = typeof tls === "object" ? tls : {};
  const ca = given.ca ?? environment("MARBLE_TLS_CA");
  const certificate = given.certificate ?? environment("MARBLE_TLS_CERTIFICATE");
  const key = given.key ?? environment("MARBLE_TLS_KEY");
  if (tls === false || (tls === undefined && ca === undefined && certificate === undefined && key === undefined)) {
    return undefined;
  }
  if ((certificate === undefined) !== (key === undefined)) {
    throw invalid(key === undefined ? "tls.key" : "tls.certificate", "certificate and key must be given together");
  }
  return {
    ca: readPem("tls.ca", ca),
    certificate: readPem("tls.certificate", certificate),
    key: readPem("tls.key", key),
    serverName: given.serverName,
  };
}

// gRPC would detect it only at the first handshake, and report "unavailable".
function readPem(field: string, path: string | undefined): Buffer | undefined {
  if (path === undefined) return undefined;
  let content: Buffer;
  try {
    content = readFileSync(path);
  } catch (error) {
    throw invalid(field, `cannot be read: ${(error as Error).message}`, { value: path });
  }
  if (!content.includes("-----BEGIN ")) throw invalid(field, "must be a PEM file", { value: path });
  return content;
}

function processName(): string {
  const program = basename(process.argv[1] ?? "node").replace(/\.[cm]?js$/, "");
  return `${program.slice(0, 40).replace(/[^!-~]/g, "_")}-${process.pid}`;
}

function environment(name: string): string | undefined {
  const value = process.env[name];
  return value === "" ? undefined : value;
}
