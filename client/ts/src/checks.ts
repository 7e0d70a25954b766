// Checks of parameters that several calls have.
import { invalid } from "./errors.js";

/** Longer deadlines overflow gRPC's counter and count as none. About 68 years. */
const longestMs = 2 ** 31 * 1000;

/** A deadline in milliseconds > 0, or none. */
export function checkDeadline(field: string, milliseconds: number | undefined): void {
  if (milliseconds === undefined || (typeof milliseconds === "number" && milliseconds > 0)) return;
  throw invalid(field, "must be > 0", { value: milliseconds });
}

/** The deadline, or undefined if it never passes. */
export function untilForever(milliseconds: number | undefined): number | undefined {
  return milliseconds !== undefined && milliseconds < longestMs ? milliseconds : undefined;
}

/** A whole number >= 0 that fits the contract; 0 if there is none. */
export function wholeOrZero(field: string, value: number | undefined): number {
  if (value === undefined) return 0;
  if (Number.isInteger(value) && value >= 0 && value <= 0x7fffffff) return value;
  throw invalid(field, "must be a whole number in [0, 2^31)", { value });
}

/** Seconds >= 0; 0 if there are none. */
export function secondsOrZero(field: string, value: number | undefined): number {
  if (value === undefined) return 0;
  if (Number.isFinite(value) && value >= 0) return value;
  throw invalid(field, "must be a number >= 0", { value });
}
