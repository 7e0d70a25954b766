// How the page shows states and errors.

import { errorNames, errors, statuses } from "./shared/tables.js";

/** "STATUS_TIME_LIMIT" and "STATUS_" → "time_limit"; "" for the unspecified one. */
export function short(name, prefix) {
  const word = String(name ?? "").startsWith(prefix) ? name.slice(prefix.length).toLowerCase() : "";
  return word === "unspecified" ? "" : word;
}

export function errorWords(code) {
  const name = errorNames[code];
  return { name: name ?? `code_${code}`, ...(errors[name] ?? { means: "The job ended in an error.", advice: "" }) };
}

export const STATES = {
  running: "A worker is processing it.",
  queued: "It waits for a worker.",
  idle: "A session between updates. It occupies no worker.",
  finished: "It has finished.",
};

// A sign for each, so that colour is not the only difference.
const SIGNS = { good: "✓", soft: "◐", bad: "✕", running: "▶", queued: "…", idle: "‖", quiet: "–" };

/** The status column of a job: its state until it has finished, then its status. */
export function outcome(job) {
  if (job.state !== "finished") return { word: job.state, tone: job.state, sign: SIGNS[job.state] ?? SIGNS.quiet };
  if (job.error) {
    const { name } = errorWords(job.error.code);
    const tone = name === "cancelled" ? "soft" : "bad";
    return { word: name, tone, sign: SIGNS[tone] };
  }
  const tone = statuses[job.status]?.tone ?? "quiet";
  return { word: job.status || "ended", tone, sign: SIGNS[tone] };
}
