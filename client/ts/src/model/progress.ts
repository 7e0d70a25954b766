import { unpackDoubles } from "../base/packed.js";
import type { Progress as Message, Violations as ViolationsMessage } from "../generated/marble/v1/progress.js";

/** Largest violations in the problem's own units; 0 where there is no such constraint. */
export interface Violations extends ViolationsMessage {}

/** What is told of the tree of option global; infinite where it is not known. */
export interface Tree {
  /** No feasible point has an objective below this; −Infinity where none is known, Infinity of a proved infeasible problem. */
  bound: number;
  /** (objective − bound) / max(1, |objective|), ≥ 0; Infinity without a feasible point or a bound. */
  gap: number;
  /** Nodes that were bounded; 0 before a tree has begun. */
  nodes: number;
  /** Nodes still to be bounded or branched. */
  openNodes: number;
}

type TreeMessage = { bound?: number | undefined; gap?: number | undefined; nodes: number; openNodes: number };

export function treeOf({ bound, gap, nodes, openNodes }: TreeMessage): Tree {
  return { bound: bound ?? -Infinity, gap: gap ?? Infinity, nodes, openNodes };
}

/** The state of a solve after one iteration. */
export interface Progress extends Omit<Message, "violations" | "z" | "incumbent" | keyof Tree>, Tree {
  violations: Violations;
  /** Of option global: objective of the best point so far; Infinity while there is none. */
  incumbent: number;
  /** The iterate, n entries, where it was asked for and its turn came. */
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
