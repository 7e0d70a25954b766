import { type ChannelOptions, Client, Metadata, credentials } from "@grpc/grpc-js";

import { checkDeadline } from "../base/checks.js";
import { PreconditionError, invalid } from "../base/errors.js";
import { targetOf } from "./addresses.js";
import { type ConnectOptions, type Pems, identityOf } from "./connect-options.js";
import { healthyRoundRobin } from "./health.js";

/** One channel, and who calls over it. */
export class Connection {
  readonly address: string;
  private readonly channel: Client;
  private closed = false;
  readonly deadlineMs?: number;
  private readonly token?: string;
  private readonly name: string;

  constructor(address: string, options: ConnectOptions) {
    const target = targetOf(address);
    const identity = identityOf(options);
    checkDeadline("deadlineMs", options.deadlineMs);
    this.address = address;
    this.deadlineMs = options.deadlineMs;
    this.token = identity.token;
    this.name = identity.name;
    this.channel = new Client(target.name, credentialsOf(identity.tls), channelOptions(identity.tls, target.several));
  }

  /** The channel; throws a PreconditionError of one that was closed. */
  open(): Client {
    if (this.closed) throw new PreconditionError("failed_precondition", "the client is closed");
    return this.channel;
  }

  close(): void {
    this.closed = true;
    this.channel.close();
  }

  metadata(): Metadata {
    const metadata = new Metadata();
    if (this.token !== undefined) metadata.set("authorization", `Bearer ${this.token}`);
    metadata.set("marble-client", this.name);
    return metadata;
  }
}

function credentialsOf(pems: Pems | undefined): ReturnType<typeof credentials.createInsecure> {
  if (pems === undefined) return credentials.createInsecure();
  try {
    return credentials.createSsl(pems.ca, pems.key, pems.certificate);
  } catch (error) {
    throw invalid("tls", `cannot be used: ${(error as Error).message}`);
  }
}

// Only what is the same when it is asked twice: a solve is repeated at no harm, a stream of one only until its first
// event, and a submission is one job by its request id. A session or a batch would lose what it was sent.
const repeatable = [
  ...["Solve", "SolveStream", "SolveScenarios", "SolveCoupled"].map((method) => ({ service: "marble.v1.Solver", method })),
  ...["Submit", "Result", "List", "Get", "Watch"].map((method) => ({ service: "marble.v1.Jobs", method })),
  { service: "marble.v1.Server" },
];

const retries = {
  methodConfig: [
    {
      name: repeatable,
      retryPolicy: {
        maxAttempts: 4,
        initialBackoff: "0.1s",
        maxBackoff: "1s",
        backoffMultiplier: 3,
        retryableStatusCodes: ["UNAVAILABLE"],
      },
    },
  ],
};

function channelOptions(pems: Pems | undefined, several: boolean): ChannelOptions {
  const mebibyte = 1 << 20;
  const turns = several ? { loadBalancingConfig: [{ [healthyRoundRobin]: {} }] } : {};
  const options: ChannelOptions = {
    "grpc.service_config": JSON.stringify({ ...retries, ...turns }),
    "grpc.service_config_disable_resolution": 1,
    // A request beyond this is sent once.
    "grpc.per_rpc_retry_buffer_size": 16 * mebibyte,
    "grpc.retry_buffer_size": 64 * mebibyte,
    // The server has its limit; the client must not be the one that cannot read an answer.
    "grpc.max_receive_message_length": -1,
    "grpc.max_send_message_length": -1,
    // A server that is gone without a word is noticed in the sum of the two.
    "grpc.keepalive_time_ms": 30_000,
    "grpc.keepalive_timeout_ms": 15_000,
    // A server that was restarted is found again soon.
    "grpc.initial_reconnect_backoff_ms": 100,
    "grpc.max_reconnect_backoff_ms": 2_000,
    // http_proxy is set for browsers; a solver on loopback or in the same rack is not behind it.
    "grpc.enable_http_proxy": 0,
  };
  if (pems?.serverName !== undefined) {
    options["grpc.ssl_target_name_override"] = pems.serverName;
    options["grpc.default_authority"] = pems.serverName;
  }
  return options;
}
