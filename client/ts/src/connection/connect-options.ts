import { readFileSync } from "node:fs";
import { basename } from "node:path";

import { invalid } from "../base/errors.js";
import * as tables from "../base/tables.js";

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
  /** Hard limit of calls that have none of their own, in milliseconds > 0; not of batches, sessions, watching. Default: none. */
  deadlineMs?: number;
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
