import { unpackDoubles } from "../packed.js";
import type { Progress as Message, Violations as ViolationsMessage } from "../generated/marble/v1/progress.js";

/** Largest violations in the problem's units; 0 if there are no such constraints. */
export interface Violations extends ViolationsMessage {}

/** The branch-and-bound tree of option global_search; unknown numbers are infinite. */
export interface Tree {
  /** Lower bound of the objective; −Infinity if none is known, Infinity if the problem is proved infeasible. */
  bound: number;
  /** (objective − bound) / max(1, |objective|), ≥ 0; Infinity without a feasible point or a bound. */
  gap: number;
  /** The number of bounded nodes; 0 without a tree. */
  nodes: number;
  /** The number of open nodes. */
  openNodes: number;
}

type TreeMessage = { bound?: number | undefined; gap?: number | undefined; nodes: number; openNodes: number };

export function treeOf({ bound, gap, nodes, openNodes }: TreeMessage): Tree {
  return { bound: bound ?? -Infinity, gap: gap ?? Infinity, nodes, openNodes };
}

/** The state of a solve after one iteration. */
export interface Progress extends Omit<Message, "violations" | "z" | "incumbent" | keyof Tree>, Tree {
  violations: Violations;
  /** With option global_search, the objective of the best point so far; Infinity if there is none. */
  incumbent: number;
  /** The iterate, n entries, if this row has it: see `iterateEvery`. */
  z?: Float64Array;
}

export function progressOf(message: Message): Progress {
  const { z, violations, ...rest } = message;
  const incumbent = message.incumbent ?? Infinity;
  const row: Progress = { ...rest, violations: violationsOf(violations), incumbent, ...treeOf(message) };
  if (z.length > 0) row.z = unpackDoubles(z);
  return row;
}

export function violationsOf(message: ViolationsMessage | undefined): Violations {
  return message ?? { equality: 0, inequality: 0, complementarity: 0 };
}
