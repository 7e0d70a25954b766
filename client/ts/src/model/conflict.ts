import { unpackIntegers } from "../base/packed.js";
import type { Conflict as Message } from "../generated/marble/v1/solution.js";

/**
 * Parts of a problem that no point meets together, whatever the others are. All indices are 0-based, ascending and of the
 * problem's own rows. A pair enters by up to three parts: each of its sides being nonnegative, and one of them being zero.
 * One that enters by its sides alone conflicts whatever complements what.
 */
export interface Conflict {
  /** Rows of A z + b = 0. */
  readonly equalities: Int32Array;
  /** Rows of C z + d ≥ 0. */
  readonly inequalities: Int32Array;
  /** Pairs of which L z + l ≥ 0 is needed. */
  readonly leftSides: Int32Array;
  /** Pairs of which R z + r ≥ 0 is needed. */
  readonly rightSides: Int32Array;
  /** Pairs of which L z + l = 0 or R z + r = 0 is needed. */
  readonly complementarities: Int32Array;
  /**
   * Irreducible: without any one of these parts the others have a point, which was found and meets the tolerances. False
   * where a limit came first: the parts conflict all the same, but fewer of them may.
   */
  readonly minimal: boolean;
  /** One sentence: what was proved, or which limit came first; and the work. */
  readonly detail: string;
  /** Linear programs that were solved for it. */
  readonly linearPrograms: number;
  /** Factorizations of them; the solution's `factorizations` has them too. */
  readonly factorizations: number;
}

export function conflictOf(message: Message): Conflict {
  return {
    equalities: unpackIntegers(message.equalities),
    inequalities: unpackIntegers(message.inequalities),
    leftSides: unpackIntegers(message.leftSides),
    rightSides: unpackIntegers(message.rightSides),
    complementarities: unpackIntegers(message.complementarities),
    minimal: message.minimal,
    detail: message.detail,
    linearPrograms: message.linearPrograms,
    factorizations: message.factorizations,
  };
}
