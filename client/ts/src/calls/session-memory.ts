import { packDoubles, unpackDoubles } from "../packed.js";
import { matrices, matrixValues, vectors } from "../shared/tables.js";
import { HessianForm, type Problem as ProblemMessage } from "../generated/marble/v1/problem.js";
import type {
  ProblemUpdate as UpdateMessage,
  SessionSetup,
  SessionUpdate,
} from "../generated/marble/v1/session.js";
import type { Csc } from "../model/matrix.js";

/** The set-up that would open the session again in its current state. */
export class SessionMemory {
  private lastZ?: Float64Array;

  /** @param hessian the pattern of Q, if there is one. */
  constructor(
    private setup: SessionSetup,
    private readonly hessian: Csc | undefined,
  ) {}

  /** Applies an update that the server has taken: its data, options and starting point. */
  take({ problem, options, initialPoint, ...start }: SessionUpdate): void {
    const before = this.setup;
    this.setup = { ...before, initialPoint: initialPoint ?? before.initialPoint };
    if (problem && before.problem) this.setup.problem = this.changed(before.problem, problem);
    if (options) {
      const given = Object.fromEntries(Object.entries(options).filter(([, value]) => value !== undefined));
      const scalingPasses = before.options?.scalingPasses; // stays
      this.setup.options = { ...options, ...before.options, ...given, scalingPasses };
    }
    this.lastZ = shifted(this.lastZ, start);
    if (this.lastZ !== undefined && initialPoint !== undefined) this.lastZ = unpackDoubles(initialPoint.z);
  }

  /** The next solve starts from this z, or from the session's starting point if it is undefined. */
  startFrom(z: Uint8Array | undefined): void {
    this.lastZ = z && unpackDoubles(z);
  }

  /** The set-up whose starting point is that of the first solve among these updates. */
  setupFor(updates: Iterable<SessionUpdate>, epoch: number): SessionSetup {
    let z = this.lastZ;
    for (const update of updates) {
      z = shifted(z, update);
      if (!update.prepare) break;
    }
    return { ...this.setup, initialPoint: z ? { z: packDoubles(z) } : this.setup.initialPoint, epoch };
  }

  private changed(problem: ProblemMessage, update: UpdateMessage): ProblemMessage {
    const now = { ...problem, constant: update.constant ?? problem.constant };
    for (const field of Object.values(vectors)) if (update[field].length > 0) now[field] = update[field];
    for (const letter of Object.keys(matrices) as (keyof typeof matrices)[]) {
      const [matrix, values] = [now[matrices[letter]], update[matrixValues[letter]]];
      if (matrix !== undefined && values.length > 0) now[matrices[letter]] = { ...matrix, values };
    }
    if (now.hessian !== undefined && update.hessianValues.length > 0) {
      now.hessian = { ...now.hessian, values: this.mirrored(now.hessianForm, now.hessian.values) };
    }
    return now;
  }

  // In an update of a full Q only the upper triangle counts; a set-up must be symmetric.
  private mirrored(form: HessianForm, packed: Uint8Array): Uint8Array {
    if (form === HessianForm.HESSIAN_FORM_UPPER_TRIANGLE || this.hessian === undefined) return packed;
    const { columns, columnPointers, rowIndices } = this.hessian;
    const values = unpackDoubles(packed);
    for (let column = 0; column < columns; ++column) {
      for (let entry = columnPointers[column]; entry < columnPointers[column + 1]; ++entry) {
        const row = rowIndices[entry];
        if (row <= column) continue;
        const image = rowIndices.subarray(columnPointers[row], columnPointers[row + 1]).indexOf(column);
        values[entry] = image < 0 ? 0 : values[columnPointers[row] + image];
      }
    }
    return packDoubles(values);
  }
}

// The starting point z, shifted; undefined for a cold start.
function shifted(z: Float64Array | undefined, start: Pick<SessionUpdate, "cold" | "shift">): Float64Array | undefined {
  if (z === undefined || start.cold) return undefined;
  const result = z.slice();
  for (const { first, count, by } of start.shift?.variables ?? []) {
    if (by > count || first + count > z.length) continue; // the server refuses it
    result.copyWithin(first, first + by, first + count);
  }
  return result;
}
