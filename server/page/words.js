// What the contract's enums mean, in words: one line each, and what to try.

/** "STATUS_TIME_LIMIT" and "STATUS_" → "time_limit"; "" for the unspecified one. */
export function short(name, prefix) {
  const word = String(name ?? "").startsWith(prefix) ? name.slice(prefix.length).toLowerCase() : "";
  return word === "unspecified" ? "" : word;
}

/** good, soft (an answer that is not solved, or less than asked), bad, quiet. */
export const STATUSES = {
  solved: { tone: "good", means: "All tolerances are met.", advice: "" },
  solved_reduced: {
    tone: "soft",
    means: "Feasible to 100 times the tolerances, but no further progress was possible.",
    advice: "Use it if that is enough. Else look at which violation is largest and scale those rows, or loosen that tolerance.",
  },
  iteration_limit: {
    tone: "soft",
    means: "max_iterations was reached; this is the best iterate.",
    advice: "If the curves still fall, raise max_iterations. If they are flat, another start (x0, or starts above 1) helps more than more iterations.",
  },
  time_limit: {
    tone: "soft",
    means: "time_limit_s was reached; this is the best iterate.",
    advice: "Look at where the time went: raise time_limit_s, lower local_search_budget, or start warm in a session.",
  },
  cancelled: {
    tone: "soft",
    means: "The solve was told to end, by its client, by cancel or by a server that shuts down; this is the best iterate.",
    advice: "Send it again if nobody meant to end it.",
  },
  infeasible: {
    tone: "bad",
    means: "No point meets the constraints, even without complementarity; the certificate in the answer proves it.",
    advice: "The problem contradicts itself: check signs and offsets of A, b, C, d, l and r. The largest multipliers in the certificate name the rows that clash.",
  },
  locally_infeasible: {
    tone: "bad",
    means: "The search ended where the violation cannot be lowered any further; no feasible point is near. Others may exist elsewhere.",
    advice: "Start elsewhere (x0), try starts = 8, or raise local_search_budget. If it happens with every start, suspect the data of the largest violation.",
  },
  unbounded: {
    tone: "bad",
    means: "The objective falls without end along a feasible direction, which is the certificate in the answer.",
    advice: "A bound or a cost is missing: the entries of that direction name the variables.",
  },
  numerical_failure: {
    tone: "bad",
    means: "No acceptable step was found within the bounded number of tries.",
    advice: "Mostly a matter of scale: bring the data nearer to 1, avoid nearly equal rows, keep scaling_passes above 0, or try path = paper.",
  },
};

// google.rpc.Code.
const ERRORS = {
  1: ["cancelled", "Its client gave it up, or it was ended before it had an answer."],
  3: ["invalid_argument", "The request is not a problem that can be solved: the field, index and rule below say where."],
  4: ["deadline_exceeded", "Its deadline passed before there was an answer: allow more time, or send it with a higher priority."],
  5: ["not_found", "What it names is not here, or not any more."],
  7: ["permission_denied", "The caller lacks the role for it."],
  8: ["resource_exhausted", "A limit of the server or of the client's quota was reached: try again later, with less, or raise the limit."],
  9: ["failed_precondition", "It does not fit what was set up before it."],
  10: ["aborted", "The server ended it: a session without an update for too long."],
  13: ["internal", "A fault of the server. Its log tells more under this job id; please report it."],
  14: ["unavailable", "The server was shutting down. It is safe to send it again, here later or elsewhere."],
  16: ["unauthenticated", "The caller showed no token or certificate that is known."],
};

export function errorWords(code) {
  const [name, means] = ERRORS[code] ?? [`code_${code}`, "The job ended in an error."];
  return { name, means };
}

export const STATES = {
  running: "A worker has it.",
  queued: "It waits for a worker.",
  idle: "A session between updates: it holds no worker.",
  finished: "It has finished.",
};

// A sign for each, so that nothing is told by colour alone.
const SIGNS = { good: "✓", soft: "◐", bad: "✕", running: "▶", queued: "…", idle: "‖", quiet: "–" };

/** What stands in the column "status" of a job: its state until it has finished, then how it ended. */
export function outcome(job) {
  if (job.state !== "finished") return { word: job.state, tone: job.state, sign: SIGNS[job.state] ?? SIGNS.quiet };
  if (job.error) {
    const { name } = errorWords(job.error.code);
    const tone = name === "cancelled" ? "soft" : "bad";
    return { word: name, tone, sign: SIGNS[tone] };
  }
  const tone = STATUSES[job.status]?.tone ?? "quiet";
  return { word: job.status || "ended", tone, sign: SIGNS[tone] };
}
