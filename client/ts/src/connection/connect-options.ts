import { readFileSync } from "node:fs";
import { basename } from "node:path";

import { invalid } from "../base/errors.js";
import * as tables from "../shared/tables.js";

/** How a client reaches its server and says who it is; all of it optional. */
export interface ConnectOptions {
  /** Sent with every call, in plaintext too. Default: the environment's `MARBLE_TOKEN`. Printable ASCII without spaces. */
  token?: string;
  /** Encrypt; `true` with Node's own authorities. Default: on if one of the `MARBLE_TLS_` variables is set. */
  tls?: boolean | TlsOptions;
  /**
   * What the client calls itself, for a server that does not know better; at most 64 printable characters. Default:
   * `MARBLE_CLIENT_NAME`, else the program's name with its process id, so that two planners on one machine take turns.
   */
  name?: string;
  /** Hard limit of calls without one of their own, in milliseconds > 0; not of batches, sessions, watching. Default: none. */
  deadlineMs?: number;
  /**
   * When a server that is gone without a word counts as lost: `default` after 45 s at most, `control_loop` after 13 s, the
   * least that a server permits if it is not told otherwise, or times of one's own. Default: `default`.
   */
  keepalive?: "default" | "control_loop" | Keepalive;
  /**
   * How long a call waits for a server that is lost, from the loss on, in milliseconds >= 0, within its own deadline:
   * what may be sent twice is tried again every 0.1 to 1 s, a session's set-up and what a batch has no answer to as well.
   * Default 10,000 once a server has answered, else 0, so that a wrong address is told at once.
   */
  waitMs?: number;
  /**
   * Calls at once on one connection, in [1, 2^31); default 900. A session is one, as are a batch and all else that waits
   * for an answer; with more there is another connection. To be some below the server's `--connection-streams`, 1024 by
   * default: gRPC silently keeps further calls back.
   */
  connectionStreams?: number;
}

/** Pings while there are calls: a server that does not answer one is lost. */
export interface Keepalive {
  /**
   * Silence before a ping, in whole milliseconds in [500, 2^31). Not below half the server's `--keepalive-s`, which is
   * 10,000 ms by default: it closes the connections of clients that ping more often.
   */
  timeMs: number;
  /** How long an answer may take, in whole milliseconds in [1, 2^31). */
  timeoutMs: number;
}

/** PEM files: read once, by `connect`. */
export interface TlsOptions {
  /** Who may vouch for the server. Default: `MARBLE_TLS_CA`, else Node's own authorities. */
  ca?: string;
  /** The client's own certificate, together with `key`. Default: `MARBLE_TLS_CERTIFICATE`. */
  certificate?: string;
  /** The private key of `certificate`. Default: `MARBLE_TLS_KEY`. */
  key?: string;
  /** The name in the server's certificate, where it is not the address's host. */
  serverName?: string;
}

/** Files' contents instead of their names. */
export interface Pems {
  ca?: Buffer;
  certificate?: Buffer;
  key?: Buffer;
  serverName?: string;
}

/** What was said, and the environment where nothing was. */
export interface Identity {
  token?: string;
  name: string;
  /** Absent for plaintext. */
  tls?: Pems;
}

export function defaultAddress(): string {
  return environment("MARBLE_SERVER") ?? tables.defaultAddress;
}

export function identityOf(options: ConnectOptions): Identity {
  const token = options.token ?? environment("MARBLE_TOKEN");
  if (token !== undefined && !/^[!-~]+$/.test(token)) {
    throw invalid("token", "must be printable ASCII without spaces"); // and stays untold
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

// Permitted are 10 s, by the server's clock; a late ping and a punctual one after it must not be nearer than that.
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

// What gRPC would otherwise find out at the first handshake, and tell as "unavailable".
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
