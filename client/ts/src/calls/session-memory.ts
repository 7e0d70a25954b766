import { packDoubles, unpackDoubles } from "../base/packed.js";
import { matrices, matrixValues, vectors } from "../shared/tables.js";
import { HessianForm, type Problem as ProblemMessage } from "../generated/marble/v1/problem.js";
import type {
  ProblemUpdate as UpdateMessage,
  SessionSetup,
  SessionUpdate,
} from "../generated/marble/v1/session.js";
import type { Csc } from "../model/matrix.js";

/** What a session would have to be told to be set up again as it is now. */
export class SessionMemory {
  private lastZ?: Float64Array;

  /** @param hessian the pattern of Q, where there is one. */
  constructor(
    private setup: SessionSetup,
    private readonly hessian: Csc | undefined,
  ) {}

  /** The server took the update in: its numbers, options and start hold from now on. */
  take({ problem, options, initialPoint, ...start }: SessionUpdate): void {
    const before = this.setup;
    this.setup = { ...before, initialPoint: initialPoint ?? before.initialPoint };
    if (problem && before.problem) this.setup.problem = this.changed(before.problem, problem);
    if (options) {
      const given = Object.fromEntries(Object.entries(options).filter(([, value]) => value !== undefined));
      const scalingPasses = before.options?.scalingPasses; // stays
      this.setup.options = { ...options, ...before.options, ...given, scalingPasses };
    }
    this.lastZ = moved(this.lastZ, start);
    if (this.lastZ !== undefined && initialPoint !== undefined) this.lastZ = unpackDoubles(initialPoint.z);
  }

  /** The next solve starts from an answer's z; from the session's own start where there is none any more. */
  startFrom(z: Uint8Array | undefined): void {
    this.lastZ = z && unpackDoubles(z);
  }

  /** The set-up that starts where the first of these updates would have, up to the one that is solved. */
  setupFor(updates: Iterable<SessionUpdate>, epoch: number): SessionSetup {
    let z = this.lastZ;
    for (const update of updates) {
      z = moved(z, update);
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

  // Of a full Q's update only the upper triangle counts; a set-up must have both alike.
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

// Where a solve starts that would have started at z.
function moved(z: Float64Array | undefined, start: Pick<SessionUpdate, "cold" | "shift">): Float64Array | undefined {
  if (z === undefined || start.cold) return undefined;
  const result = z.slice();
  for (const { first, count, by } of start.shift?.variables ?? []) {
    if (by > count || first + count > z.length) continue; // the server's to refuse
    result.copyWithin(first, first + by, first + count);
  }
  return result;
}
