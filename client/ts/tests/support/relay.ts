import { once } from "node:events";
import { type AddressInfo, type Socket, connect, createServer } from "node:net";

/** More than a connection's beginning has, less than the requests whose answers get lost. */
const requestBytes = 4000;

/** Between clients and a server: keeps back what the server says to a request. */
export class Relay {
  private readonly ends = new Set<Socket>();
  private loses = true;

  private constructor(
    private readonly listener: ReturnType<typeof createServer>,
    private readonly server: { host: string; port: number },
  ) {
    listener.on("connection", (client) => this.pass(client));
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

  private pass(client: Socket): void {
    const server = connect(this.server);
    let asked = 0;
    client.on("data", (data) => {
      asked += data.length;
      server.write(data);
    });
    server.on("data", (data) => {
      if (!this.loses || asked <= requestBytes) client.write(data);
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

  /** Ends the connections there are; those that come get their answers. */
  cut(): void {
    this.loses = false;
    for (const end of this.ends) end.destroy();
  }

  [Symbol.dispose](): void {
    this.listener.close();
    this.cut();
  }
}
