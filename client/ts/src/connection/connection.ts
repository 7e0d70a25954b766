import { type ChannelOptions, Client, Metadata, connectivityState, credentials } from "@grpc/grpc-js";

import { checkDeadline } from "../checks.js";
import { PreconditionError, invalid } from "../errors.js";
import { targetOf } from "./addresses.js";
import { Channels, type Place } from "./channels.js";
import {
  type ConnectOptions,
  type Keepalive,
  type Pems,
  checkStreams,
  checkWait,
  identityOf,
  keepaliveOf,
} from "./connect-options.js";
import { healthyRoundRobin } from "./health.js";

const defaultWaitMs = 10_000;

/** A connection to one or several servers, with the client's identity. */
export class Connection {
  readonly address: string;
  private readonly channels: Channels;
  private closed = false;
  readonly deadlineMs?: number;
  private reached = false;
  private readonly givenWaitMs?: number;
  private readonly token?: string;
  private readonly name: string;

  constructor(address: string, options: ConnectOptions) {
    const target = targetOf(address);
    const identity = identityOf(options);
    checkDeadline("deadlineMs", options.deadlineMs);
    this.address = address;
    this.deadlineMs = options.deadlineMs;
    this.givenWaitMs = checkWait(options.waitMs);
    this.token = identity.token;
    this.name = identity.name;
    const secrets = credentialsOf(identity.tls);
    const settings = channelOptions(identity.tls, target.several, keepaliveOf(options.keepalive));
    this.channels = new Channels(
      () => this.watched(new Client(target.name, secrets, settings)),
      checkStreams(options.connectionStreams),
    );
  }

  /** How long a call waits for a lost server, in milliseconds. */
  get waitMs(): number {
    return this.givenWaitMs ?? (this.reached ? defaultWaitMs : 0);
  }

  /** Reserves a connection for one call; throws a PreconditionError if the client is closed. */
  take(): Place {
    if (this.closed) throw new PreconditionError("failed_precondition", "the client is closed");
    return this.channels.take();
  }

  close(): void {
    this.closed = true;
    this.channels.close();
  }

  // Watches a new client until a server was reached once.
  private watched(client: Client): Client {
    const channel = client.getChannel();
    const check = (): void => {
      const state = channel.getConnectivityState(false);
      if (state === connectivityState.READY) this.reached = true;
      if (this.reached || state === connectivityState.SHUTDOWN) return;
      channel.watchConnectivityState(state, Infinity, check);
    };
    check();
    return client;
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

function channelOptions(pems: Pems | undefined, several: boolean, keepalive: Keepalive): ChannelOptions {
  const turns = several ? { loadBalancingConfig: [{ [healthyRoundRobin]: {} }] } : {};
  const options: ChannelOptions = {
    "grpc.service_config": JSON.stringify({ methodConfig: [], ...turns }),
    "grpc.service_config_disable_resolution": 1,
    // Separate connections per client, so that the client counts all calls of a connection.
    "grpc.use_local_subchannel_pool": 1,
    // The server has limits of its own; the client accepts results of any size.
    "grpc.max_receive_message_length": -1,
    "grpc.max_send_message_length": -1,
    // A server that disappears without closing the connection is detected after the sum of the two.
    "grpc.keepalive_time_ms": keepalive.timeMs,
    "grpc.keepalive_timeout_ms": keepalive.timeoutMs,
    // Reconnect quickly to a restarted server.
    "grpc.initial_reconnect_backoff_ms": 100,
    "grpc.max_reconnect_backoff_ms": 1_000,
    // http_proxy is meant for browsers; a solver on the same host or in the same rack is not behind it.
    "grpc.enable_http_proxy": 0,
  };
  if (pems?.serverName !== undefined) {
    options["grpc.ssl_target_name_override"] = pems.serverName;
    options["grpc.default_authority"] = pems.serverName;
  }
  return options;
}
