// As many connections as the calls at once want: a server takes so many on each, and gRPC keeps back further ones.
import type { Client } from "@grpc/grpc-js";

interface Channel {
  client: Client;
  calls: number;
}

/** A place on a connection, for one call. */
export interface Place {
  channel: Client;
  /** The call has ended. To be called once. */
  release(): void;
}

/** Connections to the same servers. A call takes the one with the fewest calls, and a new one where all are full. */
export class Channels {
  private readonly channels: Channel[] = [];

  /**
   * @param make a client with a connection of its own.
   * @param most calls at once on each, at least 1.
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

  // One that nobody needs any more is closed; the half, so that none comes and goes with every call.
  private release(channel: Channel): void {
    if (--channel.calls > 0) return;
    const others = this.channels.filter((one) => one !== channel);
    const least = this.least(others);
    if (least === undefined || least.calls > this.most / 2) return;
    this.channels.splice(this.channels.indexOf(channel), 1);
    channel.client.close();
  }
}
