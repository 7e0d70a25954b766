import { type ChannelOptions, Client, Metadata, connectivityState, credentials } from "@grpc/grpc-js";

import { checkDeadline } from "../base/checks.js";
import { PreconditionError, invalid } from "../base/errors.js";
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

/** The way to a server, or to several, and who calls over it. */
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

  /** How long a call waits for a server that is lost, in milliseconds. */
  get waitMs(): number {
    return this.givenWaitMs ?? (this.reached ? defaultWaitMs : 0);
  }

  /** A place for one call; throws a PreconditionError of a client that was closed. */
  take(): Place {
    if (this.closed) throw new PreconditionError("failed_precondition", "the client is closed");
    return this.channels.take();
  }

  close(): void {
    this.closed = true;
    this.channels.close();
  }

  // Until a server was there once.
  private watched(client: Client): Client {
    const channel = client.getChannel();
    const look = (): void => {
      const state = channel.getConnectivityState(false);
      if (state === connectivityState.READY) this.reached = true;
      if (this.reached || state === connectivityState.SHUTDOWN) return;
      channel.watchConnectivityState(state, Infinity, look);
    };
    look();
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
    // Each client has connections of its own, or what one counts on a connection would not be all.
    "grpc.use_local_subchannel_pool": 1,
    // The server has its limit; the client must not be the one that cannot read an answer.
    "grpc.max_receive_message_length": -1,
    "grpc.max_send_message_length": -1,
    // A server that is gone without a word is noticed in the sum of the two.
    "grpc.keepalive_time_ms": keepalive.timeMs,
    "grpc.keepalive_timeout_ms": keepalive.timeoutMs,
    // A server that was restarted is found again soon.
    "grpc.initial_reconnect_backoff_ms": 100,
    "grpc.max_reconnect_backoff_ms": 1_000,
    // http_proxy is set for browsers; a solver on loopback or in the same rack is not behind it.
    "grpc.enable_http_proxy": 0,
  };
  if (pems?.serverName !== undefined) {
    options["grpc.ssl_target_name_override"] = pems.serverName;
    options["grpc.default_authority"] = pems.serverName;
  }
  return options;
}
