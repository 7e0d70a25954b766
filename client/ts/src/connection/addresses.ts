// Addresses as gRPC targets.
import { experimental } from "@grpc/grpc-js";

import { invalid } from "../errors.js";
import { localAddress, longestUnixPath } from "../shared/tables.js";

/** The target of a channel. */
export interface Target {
  /** gRPC's name of the target. */
  name: string;
  /** Calls go in turn to several servers. */
  several: boolean;
}

const scheme = "marble";
const dns = "dns:///";

/**
 * Parses host:port, unix:PATH, several host:port separated by commas, or dns:///host:port (every address of the name).
 */
export function targetOf(address: string): Target {
  if (address === localAddress) throw fault(address, "must name a server: this package contains no solver");
  const parts = address.split(",").map((part) => part.trim());
  if (parts.length > 1) {
    parts.forEach(checkHostPort);
    return { name: `${scheme}:${parts.join(",")}`, several: true };
  }
  if (address.startsWith(dns)) {
    checkHostPort(address.slice(dns.length));
    return { name: address, several: true };
  }
  if (address.startsWith("unix:")) {
    const length = Buffer.byteLength(address) - "unix:".length;
    if (length < 1 || length > longestUnixPath) {
      throw fault(address, `must have a path of 1 to ${longestUnixPath} bytes after unix:`);
    }
  } else {
    checkHostPort(address);
  }
  return { name: address, several: false };
}

function fault(address: string, bound: string): Error {
  return invalid("address", bound, { value: JSON.stringify(address) });
}

function checkHostPort(address: string): void {
  if (address.startsWith("unix:")) throw fault(address, "of several addresses none may be a unix socket");
  const port = /^[^/]+:(\d{1,5})$/.exec(address)?.[1];
  if (port === undefined || Number(port) < 1 || Number(port) > 65535) {
    throw fault(address, "must be host:port, port in [1, 65535], or unix:PATH");
  }
}

type Resolution = Parameters<experimental.ResolverListener>[0];

// Several names as one target: each has its own gRPC resolver; the result is complete once all resolvers have answered.
class SeveralNames implements experimental.Resolver {
  private readonly resolvers: experimental.Resolver[];
  private readonly answers: (Resolution | undefined)[];

  constructor(
    target: experimental.GrpcUri,
    private readonly listener: experimental.ResolverListener,
    options: object,
  ) {
    const paths = target.path.split(",");
    this.answers = paths.map(() => undefined);
    this.resolvers = paths.map((path, k) =>
      experimental.createResolver({ scheme: "dns", path }, (answer) => this.take(k, answer), options),
    );
  }

  updateResolution(): void {
    for (const resolver of this.resolvers) resolver.updateResolution();
  }

  destroy(): void {
    this.answers.fill(undefined);
    for (const resolver of this.resolvers) resolver.destroy();
  }

  // If a name cannot be resolved, its last addresses and those of the other names stay valid.
  private take(k: number, answer: Resolution): boolean {
    if (answer.ok || !this.answers[k]?.ok) this.answers[k] = answer;
    const answers = this.answers.flatMap((one) => one ?? []);
    if (answers.length < this.answers.length) return true;
    const found = answers.flatMap((one) => (one.ok ? one.value : []));
    return this.listener(found.length > 0 ? experimental.statusOrFromValue(found) : answer, {}, null, "");
  }

  // The name that the servers' certificates must contain.
  static getDefaultAuthority(target: experimental.GrpcUri): string {
    return target.path.split(",")[0];
  }
}

experimental.registerResolver(scheme, SeveralNames);
