import { after, test as untimed } from "node:test";

/** node:test's, but one that hangs fails by its name. (Node 18 has no flag for that, and later ones' is a file's limit.) */
export function test(name: string, body: () => void | Promise<void>): void {
  void untimed(name, { timeout: 180_000 }, body);
}

// What such a test has left open would keep its file, and with it all others, from their end.
after(() => void setTimeout(() => process.exit(), 10_000).unref());
