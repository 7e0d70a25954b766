// Formatting of numbers.

const NONE = "–";

const three = (value) => {
  const size = Math.abs(value);
  return value.toFixed(size >= 99.95 ? 0 : size >= 9.995 ? 1 : 2);
};

/** A duration in seconds, e.g. "76.2 ms". */
export function duration(seconds) {
  if (!Number.isFinite(seconds)) return NONE;
  if (seconds < 0.9995e-3) return seconds === 0 ? "0 s" : `${three(seconds * 1e6)} µs`;
  if (seconds < 0.9995) return `${three(seconds * 1e3)} ms`;
  if (seconds < 120) return `${three(seconds)} s`;
  return longDuration(seconds);
}

function longDuration(seconds) {
  const minutes = Math.floor(seconds / 60);
  if (minutes < 60) return `${minutes} min ${Math.floor(seconds % 60)} s`;
  const hours = Math.floor(minutes / 60);
  if (hours < 48) return `${hours} h ${minutes % 60} min`;
  return `${Math.floor(hours / 24)} d ${hours % 24} h`;
}

/** An approximate age. */
export function age(seconds) {
  if (!Number.isFinite(seconds)) return NONE;
  if (seconds < 1) return "now";
  if (seconds < 60) return `${Math.floor(seconds)} s`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min`;
  if (seconds < 172800) return `${Math.floor(seconds / 3600)} h`;
  return `${Math.floor(seconds / 86400)} d`;
}

export function bytes(count) {
  if (!Number.isFinite(count)) return NONE;
  const units = ["B", "KiB", "MiB", "GiB", "TiB"];
  let unit = 0;
  while (count >= 1023.5 && unit < units.length - 1) {
    count /= 1024;
    ++unit;
  }
  return `${unit === 0 ? count : three(count)} ${units[unit]}`;
}

/** A whole number with narrow spaces between thousands. */
export function whole(count) {
  if (!Number.isFinite(count)) return NONE;
  const digits = String(Math.round(count));
  return digits.length < 5 ? digits : digits.replace(/\B(?=(\d{3})+$)/g, "\u202f");
}

/** "1st", "2nd", "11th". */
export function ordinal(number) {
  const ending = number % 100 > 10 && number % 100 < 14 ? "th" : (["th", "st", "nd", "rd"][number % 10] ?? "th");
  return `${whole(number)}${ending}`;
}

/** "1 job", "2 jobs". */
export const jobs = (count) => `${whole(count)} ${count === 1 ? "job" : "jobs"}`;

/** A rate per second. */
export const rate = (value) => (!Number.isFinite(value) ? NONE : value === 0 ? "0" : value < 0.095 ? value.toFixed(2) : three(value));

/** A fraction in [0, 1]. */
export function percent(share) {
  if (!Number.isFinite(share)) return NONE;
  const value = 100 * share;
  return `${value === 0 || value === 100 ? value : value > 99.9 ? "99.9" : value.toFixed(1)} %`;
}

/** A residual: "1.0e-15", "0" if it is that exactly. */
export function residual(value) {
  if (!Number.isFinite(value)) return Number.isNaN(value) ? "nan" : "∞";
  return value === 0 ? "0" : value.toExponential(1);
}

/** A relative gap: "12 %", "0.034 %", below that as a residual. */
export function gapText(gap) {
  if (!Number.isFinite(gap)) return NONE;
  if (gap === 0) return "0";
  return gap < 1e-4 ? residual(gap) : `${Number((100 * gap).toPrecision(2))} %`;
}

/** A short form of a large count: "1204", "12.3k", "1.2M". */
export function brief(count) {
  if (!Number.isFinite(count)) return NONE;
  if (count < 9999.5) return String(Math.round(count));
  return count < 999500 ? `${three(count / 1e3)}k` : `${three(count / 1e6)}M`;
}

/** A real number with a readable number of digits. */
export function real(value) {
  if (!Number.isFinite(value)) return String(value);
  if (value === 0) return "0";
  const size = Math.abs(value);
  return size >= 1e-3 && size < 1e7 ? String(Number(value.toPrecision(7))) : value.toExponential(3).replace(/\.?0+e/, "e");
}

export const clock = (unixSeconds) => new Date(1000 * unixSeconds).toLocaleString();
