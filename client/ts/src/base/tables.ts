// The contract's tables, for all clients. Made by proto/generate from contract.def; not to be edited.

/** The letters of the equation, and the fields of the message Problem. */
export const vectors = {
  g: "gradient",
  b: "equalityOffset",
  d: "inequalityOffset",
  l: "leftOffset",
  r: "rightOffset",
} as const;
/** The same for the matrices. */
export const matrices = {
  Q: "hessian",
  A: "equalityMatrix",
  C: "inequalityMatrix",
  L: "leftMatrix",
  R: "rightMatrix",
} as const;
/** The fields of the message ProblemUpdate with a matrix's values. */
export const matrixValues = {
  Q: "hessianValues",
  A: "equalityValues",
  C: "inequalityValues",
  L: "leftValues",
  R: "rightValues",
} as const;
/** The vectors that have an entry for each row of a matrix. */
export const offsets = {
  Q: "g",
  A: "b",
  C: "d",
  L: "l",
  R: "r",
} as const;
/** Names of the errors, by google.rpc.Code. */
export const errorNames = {
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
} as const;
/** What to try after a solve with this status; empty if nothing is wrong. */
export const statusAdvice = {
  solved: "",
  solved_reduced: "Use it if that is enough. Otherwise find the largest violation, and scale its rows or loosen its tolerance.",
  iteration_limit: "If the convergence curves still fall, raise max_iterations. If they are flat, another start (x0, or starts above 1) helps more than further iterations. If nodes are open, raise node_limit.",
  time_limit: "Check which part took the time. Then raise time_limit_s, lower local_search_budget, or use warm starts in a session.",
  cancelled: "Send the request again if the cancellation was not intended.",
  infeasible: "The problem contradicts itself: check the signs and offsets of A, b, C, d, l and r. Option explain=true, or the command marble explain, returns a smallest set of conflicting rows and pairs.",
  locally_infeasible: "If detail names ill-conditioned rows, remove one of them. Otherwise raise feasibility_budget, or start elsewhere (x0). If it happens from every start, check the data of the largest violation.",
  unbounded: "A bound or a cost is missing: the nonzero entries of that direction show the variables.",
  numerical_failure: "The cause is usually bad scaling: bring the data nearer to 1, avoid nearly equal rows, keep scaling_passes above 0, or try path = paper.",
} as const;
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
export const mostLevels = 128;
/** Entries of a vector, and rows of a matrix: below 2^28. */
export const mostRows = 268435455;
/** Largest difference of entries (i, j) and (j, i) of Q, relative to the geometric mean of the largest entries of rows
 * and columns i and j; allows for the rounding of matrix products, relative. */
export const symmetry = 1e-12;
