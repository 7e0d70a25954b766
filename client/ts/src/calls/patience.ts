import { setTimeout as sleep } from "node:timers/promises";

import { errorOf } from "../errors.js";
import type { Connection } from "../connection/connection.js";
import { cancelled, isLost } from "./status.js";

const firstPauseMs = 100;
const longestPauseMs = 1000;
/** Bounds the pause that a server requests, because its estimate may be far off. */
const longestRequestedMs = 5000;

/** Limits of one call. */
export interface Limits {
  /** When it must end, in the time of Date.now(). */
  deadline?: number;
  signal?: AbortSignal;
}

/** Limits of its attempts. */
export interface Bounds extends Limits {
  /** Total time from the first failure, in milliseconds; 0 permits no second attempt. */
  totalMs: number;
}

/** Pauses between attempts: 0.1 s, doubling up to 1 s, each varied randomly by up to 20 %. */
export class Patience {
  private pauseMs = firstPauseMs;
  private end?: number;

  constructor(private readonly bounds: Bounds) {}

  /**
   * Waits before the next attempt; the last one is at the end of the total time.
   *
   * @param error why the last attempt failed; it may request a longer pause.
   * @throws `error` if the total time is over; a DeadlineError; a CancelledError.
   */
  async pause(error: Error & { retryAfterMs?: number }): Promise<void> {
    const { totalMs, deadline, signal } = this.bounds;
    this.end ??= performance.now() + totalMs;
    const left = this.end - performance.now();
    if (left <= 0) throw error;
    const own = this.pauseMs * (0.8 + 0.4 * Math.random());
    const requested = Math.min(error.retryAfterMs ?? 0, longestRequestedMs);
    const untilDeadline = deadline === undefined ? Infinity : deadline - Date.now();
    this.pauseMs = Math.min(2 * this.pauseMs, longestPauseMs);
    try {
      await sleep(Math.max(0, Math.min(Math.max(own, requested), left, untilDeadline)), undefined, { signal });
    } catch (thrown) {
      throw signal?.aborted ? cancelled(signal) : thrown;
    }
    if (deadline === undefined || Date.now() < deadline) return;
    throw errorOf("deadline_exceeded", `the deadline passed: ${error.message}`, { cause: error });
  }
}

/** Repeats an attempt while the server is lost and the client's `waitMs` lasts. It must be safe to repeat. */
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
