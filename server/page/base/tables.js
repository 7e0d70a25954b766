// The meanings of statuses and errors. Made by proto/generate from contract.def; not to be edited.

/** tone: good, soft (not solved, or less than requested), bad. */
export const STATUSES = {
  solved: {
    tone: "good",
    means: "All tolerances are met.",
    advice: "",
  },
  solved_reduced: {
    tone: "soft",
    means: "Feasible to 100 times the tolerances, but no further progress was possible.",
    advice: "Use it if that is enough. Otherwise find the largest violation, and scale its rows or loosen its tolerance.",
  },
  iteration_limit: {
    tone: "soft",
    means: "max_iterations was reached, or with option global node_limit; this is the best iterate.",
    advice: "If the convergence curves still fall, raise max_iterations. If they are flat, another start (x0, or starts above 1) helps more than further iterations. If nodes are open, raise node_limit.",
  },
  time_limit: {
    tone: "soft",
    means: "time_limit_s was reached; this is the best iterate.",
    advice: "Check which part took the time. Then raise time_limit_s, lower local_search_budget, or use warm starts in a session.",
  },
  cancelled: {
    tone: "soft",
    means: "The solve was cancelled by its client, by a cancel call or by a server that shuts down; this is the best iterate.",
    advice: "Send the request again if the cancellation was not intended.",
  },
  infeasible: {
    tone: "bad",
    means: "No point meets the constraints. The certificate proves it even without complementarity; if it is empty, every branch of the pairs was refuted.",
    advice: "The problem contradicts itself: check the signs and offsets of A, b, C, d, l and r. Option explain=true, or the command marble explain, returns a smallest set of conflicting rows and pairs.",
  },
  locally_infeasible: {
    tone: "bad",
    means: "The search ended at a point where the violation cannot be lowered any further; no feasible point is near. One may exist elsewhere.",
    advice: "If detail names ill-conditioned rows, remove one of them. Otherwise raise feasibility_budget, or start elsewhere (x0). If it happens from every start, check the data of the largest violation.",
  },
  unbounded: {
    tone: "bad",
    means: "The objective falls without end along a feasible direction, which is the certificate.",
    advice: "A bound or a cost is missing: the nonzero entries of that direction show the variables.",
  },
  numerical_failure: {
    tone: "bad",
    means: "No acceptable step was found within the bounded number of tries.",
    advice: "The cause is usually bad scaling: bring the data nearer to 1, avoid nearly equal rows, keep scaling_passes above 0, or try path = paper.",
  },
};

/** By google.rpc.Code. */
export const ERRORS = {
  1: {
    name: "cancelled",
    means: "The caller cancelled it, or it was ended before it had a result.",
    advice: "Send the request again if the cancellation was not intended.",
  },
  3: {
    name: "invalid_argument",
    means: "The input breaks a documented rule; field and index show where.",
    advice: "Correct the entry that field and index name.",
  },
  4: {
    name: "deadline_exceeded",
    means: "Its deadline passed before it had a result.",
    advice: "Allow more time, or use a higher priority.",
  },
  5: {
    name: "not_found",
    means: "The named object does not exist, or is no longer kept.",
    advice: "Check the name, and how long such objects are kept.",
  },
  7: {
    name: "permission_denied",
    means: "The caller lacks the required role or priority.",
    advice: "Ask the operator of the server for the role.",
  },
  8: {
    name: "resource_exhausted",
    means: "A limit of the server or a quota of the client was reached.",
    advice: "Try again later, send less, or raise the limit.",
  },
  9: {
    name: "failed_precondition",
    means: "The request does not fit the current state: an update with other sizes, a result that does not exist yet.",
    advice: "Try again once the state fits.",
  },
  10: {
    name: "aborted",
    means: "The server ended it by one of its rules: a session had no update for too long.",
    advice: "Set the session up again.",
  },
  13: {
    name: "internal",
    means: "A bug in Marble.",
    advice: "The server's log has more details under the job's id; please report it.",
  },
  14: {
    name: "unavailable",
    means: "The server cannot be reached, is draining, or is not a Marble server.",
    advice: "It is safe to send the request again, later or to another server.",
  },
  16: {
    name: "unauthenticated",
    means: "The caller presented no valid token or certificate.",
    advice: "Provide a token or a certificate that the server accepts.",
  },
};
