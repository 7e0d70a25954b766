import { setTimeout as sleep } from "node:timers/promises";

import { errorOf } from "../base/errors.js";
import type { Connection } from "../connection/connection.js";
import { cancelled, isLost } from "./status.js";

const firstPauseMs = 100;
const longestPauseMs = 1000;
/** What a server may ask for: its guess of when there is room can be far off. */
const longestWishMs = 5000;

/** What bounds one call. */
export interface Limits {
  /** When it must be over, as Date.now() tells it. */
  deadline?: number;
  signal?: AbortSignal;
}

/** What bounds its tries. */
export interface Bounds extends Limits {
  /** From the first failure on, in milliseconds; 0 leaves no second try. */
  totalMs: number;
}

/** Pauses between tries: 0.1 s, then twice as long each time up to 1 s, all by up to a fifth shorter or longer. */
export class Patience {
  private pauseMs = firstPauseMs;
  private end?: number;

  constructor(private readonly bounds: Bounds) {}

  /**
   * Waits until it is worth another try, for the last time at the end of the total.
   *
   * @param error why the last try failed; it may ask for a longer pause.
   * @throws that error where nothing is left of the total; a DeadlineError, a CancelledError.
   */
  async pause(error: Error & { retryAfterMs?: number }): Promise<void> {
    const { totalMs, deadline, signal } = this.bounds;
    this.end ??= performance.now() + totalMs;
    const left = this.end - performance.now();
    if (left <= 0) throw error;
    const own = this.pauseMs * (0.8 + 0.4 * Math.random());
    const wish = Math.min(error.retryAfterMs ?? 0, longestWishMs);
    const untilDeadline = deadline === undefined ? Infinity : deadline - Date.now();
    this.pauseMs = Math.min(2 * this.pauseMs, longestPauseMs);
    try {
      await sleep(Math.max(0, Math.min(Math.max(own, wish), left, untilDeadline)), undefined, { signal });
    } catch (thrown) {
      throw signal?.aborted ? cancelled(signal) : thrown;
    }
    if (deadline === undefined || Date.now() < deadline) return;
    throw errorOf("deadline_exceeded", `the deadline passed: ${error.message}`, { cause: error });
  }
}

/** Tries again while the server is lost, for as long as the client waits; only what may be sent twice. */
export async function repeated<Result>(
  connection: Connection,
  limits: Limits,
  attempt: () => Promise<Result>,
): Promise<Result> {
  let patience: Patience | undefined;
  for (;;) {
    try {
      return await attempt();
    } catch (error) {
      if (!isLost(error)) throw error;
      patience ??= new Patience({ ...limits, totalMs: connection.waitMs });
      await patience.pause(error);
    }
  }
}
