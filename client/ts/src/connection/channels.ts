// As many connections as concurrent calls need: a server limits the calls per connection, and gRPC holds back the rest.
import type { Client } from "@grpc/grpc-js";

interface Channel {
  client: Client;
  calls: number;
}

/** The right to make one call on a connection. */
export interface Place {
  channel: Client;
  /** Must be called once, when the call has ended. */
  release(): void;
}

/** Connections to the same servers. A call uses the one with the fewest calls, or a new one if all are full. */
export class Channels {
  private readonly channels: Channel[] = [];

  /**
   * @param make creates a client with its own connection.
   * @param most the number of concurrent calls per connection, at least 1.
   */
  constructor(
    private readonly make: () => Client,
    private readonly most: number,
  ) {
    this.add();
  }

  take(): Place {
    const least = this.least(this.channels);
    const channel = least !== undefined && least.calls < this.most ? least : this.add();
    ++channel.calls;
    return { channel: channel.client, release: () => this.release(channel) };
  }

  close(): void {
    for (const { client } of this.channels) client.close();
  }

  private add(): Channel {
    const channel = { client: this.make(), calls: 0 };
    this.channels.push(channel);
    return channel;
  }

  private least(channels: Channel[]): Channel | undefined {
    return channels.length === 0 ? undefined : channels.reduce((least, one) => (one.calls < least.calls ? one : least));
  }

  // Closes an unused connection if another one is at most half full, so that connections do not open and close all the
  // time.
  private release(channel: Channel): void {
    if (--channel.calls > 0) return;
    const others = this.channels.filter((one) => one !== channel);
    const least = this.least(others);
    if (least === undefined || least.calls > this.most / 2) return;
    this.channels.splice(this.channels.indexOf(channel), 1);
    channel.client.close();
  }
}
