// The contract's tables, for all clients. Made by proto/generate from contract.def; not to be edited.

/** Fields of the message Problem by the letters of the equation. */
export const vectors = /** @type {const} */ ({
  g: "gradient",
  b: "equalityOffset",
  d: "inequalityOffset",
  l: "leftOffset",
  r: "rightOffset",
});

/** The same for the matrices. */
export const matrices = /** @type {const} */ ({
  Q: "hessian",
  A: "equalityMatrix",
  C: "inequalityMatrix",
  L: "leftMatrix",
  R: "rightMatrix",
});

/** Fields of the message ProblemUpdate with a matrix's values. */
export const matrixValues = /** @type {const} */ ({
  Q: "hessianValues",
  A: "equalityValues",
  C: "inequalityValues",
  L: "leftValues",
  R: "rightValues",
});

/** The vector with an entry for each row of a matrix. */
export const offsets = /** @type {const} */ ({
  Q: "g",
  A: "b",
  C: "d",
  L: "l",
  R: "r",
});

/** Names of errors by google.rpc.Code. */
export const errorNames = /** @type {const} */ ({
  1: "cancelled",
  3: "invalid_argument",
  4: "deadline_exceeded",
  5: "not_found",
  7: "permission_denied",
  8: "resource_exhausted",
  9: "failed_precondition",
  10: "aborted",
  12: "unavailable",
  13: "internal",
  14: "unavailable",
  16: "unauthenticated",
});

/** What each error means, and what to do. */
export const errors = /** @type {const} */ ({
  invalid_argument: {
    means: "The input breaks a documented rule; field and index show where.",
    advice: "Correct the entry that field and index name.",
  },
  failed_precondition: {
    means: "The request does not fit the current state: an update with other sizes, a result that does not exist yet.",
    advice: "Try again once the state fits.",
  },
  resource_exhausted: {
    means: "A limit of the server or a quota of the client was reached.",
    advice: "Try again later, send less, or raise the limit.",
  },
  not_found: {
    means: "The named object does not exist, or is no longer kept.",
    advice: "Check the name, and how long such objects are kept.",
  },
  unavailable: {
    means: "The server cannot be reached, is draining, or is not a Marble server.",
    advice: "It is safe to send the request again, later or to another server.",
  },
  cancelled: {
    means: "The caller cancelled it, or it was ended before it had a result.",
    advice: "Send the request again if the cancellation was not intended.",
  },
  deadline_exceeded: {
    means: "Its deadline passed before it had a result.",
    advice: "Allow more time, or use a higher priority.",
  },
  permission_denied: {
    means: "The caller lacks the required role or priority.",
    advice: "Ask the operator of the server for the role.",
  },
  unauthenticated: {
    means: "The caller presented no valid token or certificate.",
    advice: "Provide a token or a certificate that the server accepts.",
  },
  aborted: {
    means: "The server ended it by one of its rules: a session had no update for too long.",
    advice: "Set the session up again.",
  },
  internal: {
    means: "A bug in Marble.",
    advice: "The server's log has more details under the job's id; please report it.",
  },
});

/** Why solves end. tone: good, soft (not solved, or less than requested), bad. */
export const statuses = /** @type {const} */ ({
  solved: {
    tone: "good",
    means: "All tolerances are met.",
    advice: "",
  },
  almost_solved: {
    tone: "soft",
    means: "Feasible to 100 times the tolerances, but no further progress was possible.",
    advice: "Use it if that is enough. Otherwise find the largest violation, and scale its rows or loosen its tolerance.",
  },
  iteration_limit: {
    tone: "soft",
    means: "max_iterations was reached, or with option global_search node_limit; this is the best iterate.",
    advice: "If the convergence curves still fall, raise max_iterations. If they are flat, another start (x0, or num_starts above 1) helps more than further iterations. If nodes are open, raise node_limit.",
  },
  time_limit: {
    tone: "soft",
    means: "time_limit_s was reached; this is the best iterate.",
    advice: "Check which part took the time. Then raise time_limit_s, lower max_local_search_factorizations, or use warm starts in a session.",
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
    advice: "If detail names ill-conditioned rows, remove one of them. With path=paper, try path=fast. Otherwise raise max_feasibility_factorizations, or start elsewhere (x0). If it happens from every start, check the data of the largest violation.",
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
});

/** Kinds of solutions; texts have numbers and parts in braces. */
export const kinds = /** @type {const} */ ({
  proved_optimal: {
    text: "proved optimal{within}",
    advice: "",
    means: "No feasible point is better by more than relative_gap_tolerance.",
  },
  optimal: {
    text: "optimal: Q is convex, and there are no pairs",
    advice: "",
    means: "The optimum of a problem without pairs whose Q is known to be convex, within the tolerances.",
  },
  local_minimum: {
    text: "local minimum; {optimum}",
    advice: "{condition}{starts}{proof}",
    means: "No point nearby is better. A point on another branch may be better; gap, where it is known, bounds by how much.",
  },
  stationary_point: {
    text: "stationary point only: {reason}; {bound}",
    advice: "{budget}{starts}{proof}",
    means: "The solver did not decide whether it is a local minimum: the budget of the search was spent, or Q is not convex.",
  },
  saddle_point: {
    text: "saddle point: the objective falls along a direction of negative curvature",
    advice: "Raise max_local_search_factorizations or time_limit_s: the descent from the saddle point was cut short.",
    means: "The objective falls along a direction of negative curvature, and the descent was cut short.",
  },
  almost_solved: {
    text: "almost solved: the tolerances are met up to a factor of 100 only",
    advice: "{status}",
    means: "The tolerances are met only up to a factor of 100.",
  },
  proved_infeasible: {
    text: "proved infeasible: no point meets the constraints",
    advice: "{status}",
    means: "No point meets the constraints.",
  },
  no_feasible_point: {
    text: "no feasible point found; infeasibility is not proved",
    advice: "{status}",
    means: "No feasible point was found. One may exist.",
  },
  proved_unbounded: {
    text: "proved unbounded: the objective falls without end",
    advice: "{status}",
    means: "The objective falls without end.",
  },
  stopped_feasible: {
    text: "stopped at a feasible point; {bound}",
    advice: "{status}",
    means: "A limit or a cancellation ended the solve at a point that meets the tolerances.",
  },
  stopped_infeasible: {
    text: "stopped before a feasible point was found",
    advice: "{status}",
    means: "A limit or a cancellation ended the solve before a point that meets the tolerances was found.",
  },
  failed: {
    text: "failed: no acceptable step was found",
    advice: "{status}",
    means: "No acceptable step was found.",
  },
});

/** Parts of the texts of kinds. */
export const phrases = /** @type {const} */ ({
  within: " to within {distance}",
  bounded: "at most {distance} from the optimum",
  not_bounded: "no bound is known",
  optimum_if_convex: "the optimum where Q is convex",
  another_branch: "the objective falls along another branch",
  next_branch: "a better branch may lie next to it",
  curvature: "its curvature was not decided",
  if_not_convex: "Where Q is not convex: ",
  budget_spent: "The search for better branches has spent max_local_search_factorizations: a larger one lets it go on. ",
  first_starts: "num_starts=8 searches 8 times, for about 8 times the work (this solve: {factorizations}).",
  more_starts: "num_starts={more} searches twice as often, for about twice the work (this solve: {factorizations}).",
  try_global: " global_search=true searches the branches of the {pairs} for the best one and proves it; that may take much longer, and time_limit_s ends it with a bound.",
  proof_ended: " The proof did not come to its end: detail says why.",
});

/** Where a server listens by default, and the default address of clients. */
export const defaultAddress = "127.0.0.1:50051";

/** The address that means in process, without a server. */
export const localAddress = "local";

/** Hint that a client adds to the error if no server listens at the default address. */
export const noServerHint = "; start a server there (marble-server) or name another (MARBLE_SERVER=HOST:PORT)";

/** Hint that clients with a solver of their own add to that. */
export const localHint = ", or solve without one (MARBLE_SERVER=local)";

/** Of a request's id, bytes. */
export const longestRequestId = 128;

/** Of a problem's name, bytes. */
export const longestProblemName = 256;

/** Of the name that a client gives itself, and of a token's name, bytes. */
export const longestClientName = 64;

/** Of a Unix socket's path in an address, bytes. */
export const longestUnixPath = 107;

/** Largest number of jobs in one response of Jobs.List. */
export const largestPage = 10000;

/** Default number of jobs in one response of Jobs.List. */
export const defaultPage = 100;

/** Sample-average stages of one request with scenarios. */
export const mostStages = 128;

/** Entries of a vector, and rows of a matrix: below 2^28. */
export const mostRows = 268435455;

/** Largest difference of entries (i, j) and (j, i) of Q, relative to the geometric mean of the largest entries of rows
 * and columns i and j; allows for the rounding of matrix products, relative. */
export const symmetry = 1e-12;
