import type { Progress as Message, Violations as ViolationsMessage } from "./generated/marble/v1/progress.js";
import { unpackDoubles } from "./packed.js";

/** Largest violations in the problem's own units; 0 where there is no such constraint. */
export interface Violations extends ViolationsMessage {}

/** The state of a solve after one iteration. */
export interface Progress extends Omit<Message, "violations" | "z"> {
  violations: Violations;
  /** The iterate, n entries, where it was asked for and its turn came. */
  z?: Float64Array;
}

export function progressOf(message: Message): Progress {
  const { z, violations, ...rest } = message;
  const row: Progress = { ...rest, violations: violationsOf(violations) };
  if (z.length > 0) row.z = unpackDoubles(z);
  return row;
}

export function violationsOf(message: ViolationsMessage | undefined): Violations {
  return message ?? { equality: 0, inequality: 0, complementarity: 0 };
}
