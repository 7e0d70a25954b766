import { after, test as untimed } from "node:test";

/** node:test's `test` with a timeout, so that a hanging test fails by its name. Node 18 has no flag for this. */
export function test(name: string, body: () => void | Promise<void>): void {
  void untimed(name, { timeout: 180_000 }, body);
}

// Handles that such a test leaves open would keep its file from ending.
after(() => void setTimeout(() => process.exit(), 10_000).unref());
