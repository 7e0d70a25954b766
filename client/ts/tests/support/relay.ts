import { EventEmitter, once } from "node:events";
import { type AddressInfo, type Socket, connect, createServer } from "node:net";

/** More than a connection's beginning has, less than the requests whose answers get lost. */
const requestBytes = 4000;

/** A ping's head: 8 bytes, its type, no flags (an answer has one), no stream. */
const ping = Buffer.from([0, 0, 8, 6, 0, 0, 0, 0, 0]);

/** Between clients and a server: keeps back what the server says to a request, until it is told to pass it on. */
export class Relay {
  private readonly ends = new Set<Socket>();
  private readonly changed = new EventEmitter();
  private loses = true;
  private stalled = false;
  /** That there are now. */
  connections = 0;
  /** That clients have sent, of HTTP/2. */
  pings = 0;

  private constructor(
    private readonly listener: ReturnType<typeof createServer>,
    private readonly server: { host: string; port: number },
  ) {
    listener.on("connection", (client) => this.join(client));
  }

  static async to(address: string): Promise<Relay> {
    const [host, port] = address.split(":");
    const listener = createServer();
    const relay = new Relay(listener, { host, port: Number(port) });
    listener.listen(0, "127.0.0.1");
    await once(listener, "listening");
    return relay;
  }

  get address(): string {
    return `127.0.0.1:${(this.listener.address() as AddressInfo).port}`;
  }

  /** From now on nothing is kept back. */
  pass(): void {
    this.loses = false;
  }

  /** From now on everything gets lost, as if a cable were cut. */
  stall(): void {
    this.stalled = true;
  }

  /** Waits until something holds of the connections. */
  async until(holds: () => boolean): Promise<void> {
    while (!holds()) await once(this.changed, "change");
  }

  private join(client: Socket): void {
    const server = connect(this.server);
    this.count(1);
    client.on("close", () => this.count(-1));
    let asked = 0;
    client.on("data", (data) => {
      asked += data.length;
      if (data.includes(ping)) ++this.pings;
      this.changed.emit("change");
      if (!this.stalled) server.write(data);
    });
    server.on("data", (data) => {
      if (!this.stalled && (!this.loses || asked <= requestBytes)) client.write(data);
    });
    for (const [end, other] of [
      [client, server],
      [server, client],
    ]) {
      this.ends.add(end);
      end.on("error", () => {});
      end.on("close", () => other.destroy());
    }
  }

  private count(by: number): void {
    this.connections += by;
    this.changed.emit("change");
  }

  /** Ends the connections there are; those that come get their answers. */
  cut(): void {
    this.pass();
    for (const end of this.ends) end.destroy();
  }

  [Symbol.dispose](): void {
    this.listener.close();
    this.cut();
  }
}
