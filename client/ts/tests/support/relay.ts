import { EventEmitter, once } from "node:events";
import { type AddressInfo, type Socket, connect, createServer } from "node:net";

/** More bytes than the start of a connection, fewer than the requests whose responses are lost. */
const requestBytes = 4000;

/** Header of a ping: 8 bytes, its type, no flags (an acknowledgement has one), no stream. */
const ping = Buffer.from([0, 0, 8, 6, 0, 0, 0, 0, 0]);

/** A relay between clients and a server that holds back the responses to requests until `pass`. */
export class Relay {
  private readonly ends = new Set<Socket>();
  private readonly changed = new EventEmitter();
  private loses = true;
  private stalled = false;
  /** Current connections. */
  connections = 0;
  /** HTTP/2 pings sent by clients. */
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

  /** Passes everything on from now. */
  pass(): void {
    this.loses = false;
  }

  /** Loses everything from now, like a cut cable. */
  stall(): void {
    this.stalled = true;
  }

  /** Waits until a condition holds for the connections. */
  async until(holds: () => boolean): Promise<void> {
    while (!holds()) await once(this.changed, "change");
  }

  private join(client: Socket): void {
    const server = connect(this.server);
    this.count(1);
    client.on("close", () => this.count(-1));
    let received = 0;
    client.on("data", (data) => {
      received += data.length;
      if (data.includes(ping)) ++this.pings;
      this.changed.emit("change");
      if (!this.stalled) server.write(data);
    });
    server.on("data", (data) => {
      if (!this.stalled && (!this.loses || received <= requestBytes)) client.write(data);
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

  /** Ends the current connections and passes everything on later ones. */
  cut(): void {
    this.pass();
    for (const end of this.ends) end.destroy();
  }

  [Symbol.dispose](): void {
    this.listener.close();
    this.cut();
  }
}
