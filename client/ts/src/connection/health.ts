// Round-robin load balancing over the servers that report SERVING. grpc-js lacks the "healthCheckConfig" of the other
// gRPC libraries, so the health of each connection is watched here.
import { Client, type ClientReadableStream, connectivityState, credentials, experimental, status } from "@grpc/grpc-js";
import type { ServiceError } from "@grpc/grpc-js";

import {
  type HealthCheckResponse,
  HealthCheckResponse_ServingStatus as Serving,
  HealthService,
} from "../generated/grpc/health/v1/health.js";

/** The load balancing policy's name in a service config. */
export const healthyRoundRobin = "marble_healthy_round_robin";

const retryAfterMs = 1000;

class Watched extends experimental.BaseSubchannelWrapper {
  private stream?: ClientReadableStream<HealthCheckResponse>;
  private again?: NodeJS.Timeout;

  constructor(readonly inner: experimental.SubchannelInterface) {
    super(inner);
    inner.addConnectivityStateListener(this.changed);
    if (inner.getConnectivityState() === connectivityState.READY) this.watch();
  }

  protected override destroy(): void {
    this.inner.removeConnectivityStateListener(this.changed);
    this.stop();
    super.destroy();
  }

  private readonly changed: experimental.ConnectivityStateListener = (_subchannel, _before, now) => {
    this.stop();
    if (now === connectivityState.READY) this.watch();
  };

  // Over the same connection, so that it is the health of this server and needs no further connection.
  private watch(): void {
    const { path, requestSerialize, responseDeserialize } = HealthService.watch;
    const overriding = { channelOverride: this.getChannel() };
    const client = new Client(this.getAddress(), credentials.createInsecure(), overriding);
    const stream = client.makeServerStreamRequest(path, requestSerialize, responseDeserialize, { service: "" });
    this.stream = stream;
    stream.on("data", ({ status }: HealthCheckResponse) => {
      if (stream === this.stream) this.setHealthy(status === Serving.SERVING);
    });
    stream.on("error", (error: ServiceError) => {
      if (stream !== this.stream) return;
      // A server without the service counts as healthy.
      this.setHealthy(error.code === status.UNIMPLEMENTED);
      if (error.code !== status.UNIMPLEMENTED) this.watchAgain();
    });
    stream.on("end", () => {
      if (stream === this.stream) this.watchAgain();
    });
  }

  private watchAgain(): void {
    this.stop();
    this.again = setTimeout(() => this.watch(), retryAfterMs).unref();
  }

  private stop(): void {
    clearTimeout(this.again);
    const { stream } = this;
    this.stream = undefined;
    stream?.cancel();
  }
}

// gRPC expects its own connections from a picker, not the wrapped ones.
class Unwrapping implements experimental.Picker {
  constructor(private readonly inner: experimental.Picker) {}

  pick(args: experimental.PickArgs): experimental.PickResult {
    const result = this.inner.pick(args);
    if (!(result.subchannel instanceof Watched)) return result;
    return { ...result, subchannel: result.subchannel.inner } as experimental.PickResult;
  }
}

class HealthyRoundRobin implements experimental.LoadBalancer {
  private readonly turns: experimental.ChildLoadBalancerHandler;

  constructor(helper: experimental.ChannelControlHelper) {
    this.turns = new experimental.ChildLoadBalancerHandler(
      experimental.createChildChannelControlHelper(helper, {
        createSubchannel: (address, args) => new Watched(helper.createSubchannel(address, args)),
        updateState: (state, picker, message) => helper.updateState(state, new Unwrapping(picker), message),
      }),
    );
  }

  updateAddressList(...[endpoints, , options, note]: Parameters<experimental.LoadBalancer["updateAddressList"]>): boolean {
    const roundRobin = experimental.parseLoadBalancingConfig({ round_robin: {} });
    return this.turns.updateAddressList(endpoints, roundRobin, options, note);
  }

  exitIdle(): void {
    this.turns.exitIdle();
  }

  resetBackoff(): void {
    this.turns.resetBackoff();
  }

  destroy(): void {
    this.turns.destroy();
  }

  getTypeName(): string {
    return healthyRoundRobin;
  }
}

class Config implements experimental.TypedLoadBalancingConfig {
  getLoadBalancerName(): string {
    return healthyRoundRobin;
  }

  toJsonObject(): object {
    return { [healthyRoundRobin]: {} };
  }

  static createFromJson(): Config {
    return new Config();
  }
}

experimental.registerLoadBalancerType(healthyRoundRobin, HealthyRoundRobin, Config);
