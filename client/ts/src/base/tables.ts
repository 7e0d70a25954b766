// What every client knows of the contract. Made by proto/generate from contract.def; not to be edited.

/** The letters of the equation, and the fields of the message Problem. */
export const vectors = {
  g: "gradient",
  b: "equalityOffset",
  d: "inequalityOffset",
  l: "leftOffset",
  r: "rightOffset",
} as const;
/** The same of the matrices. */
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
/** What to try after a solve that ended so; empty where there is nothing to mend. */
export const statusAdvice = {
  solved: "",
  solved_reduced: "Use it if that is enough. Else look at which violation is largest and scale those rows, or loosen that tolerance.",
  iteration_limit: "If the curves still fall, raise max_iterations. If they are flat, another start (x0, or starts above 1) helps more than more iterations. Where nodes are open, raise node_limit.",
  time_limit: "Look at where the time went: raise time_limit_s, lower local_search_budget, or start warm in a session.",
  cancelled: "Send it again if nobody meant to end it.",
  infeasible: "The problem contradicts itself: check signs and offsets of A, b, C, d, l and r. Option explain=true, or marble explain, names a smallest set of rows and pairs that clash.",
  locally_infeasible: "Where the detail names ill-conditioned rows, remove one of them. Else raise feasibility_budget, or start elsewhere (x0). If it happens with every start, suspect the data of the largest violation.",
  unbounded: "A bound or a cost is missing: the entries of that direction name the variables.",
  numerical_failure: "Mostly a matter of scale: bring the data nearer to 1, avoid nearly equal rows, keep scaling_passes above 0, or try path = paper.",
} as const;
/** Where a server listens, and where a client looks for one, if nothing else is said. */
export const defaultAddress = "127.0.0.1:50051";
/** The address that means: no server, this process. */
export const localAddress = "local";
/** What a client adds where nobody listens at the default address. */
export const noServerHint = "; start a server there (marble-server) or name another (MARBLE_SERVER=HOST:PORT)";
/** What those add to it that can solve without a server. */
export const localHint = ", or solve without one (MARBLE_SERVER=local)";
/** Of a request's id, bytes. */
export const longestRequestId = 128;
/** Of a problem's name, bytes. */
export const longestProblemName = 256;
/** Of what a client calls itself, and of a token's name, bytes. */
export const longestClientName = 64;
/** Of a Unix socket's path in an address, bytes. */
export const longestUnixPath = 107;
/** Jobs that one answer of Jobs.List may have. */
export const largestPage = 10000;
/** Jobs that one answer of Jobs.List has if nothing else is said. */
export const defaultPage = 100;
/** Levels of one request with scenarios. */
export const mostLevels = 128;
/** Entries of a vector, and rows of a matrix: below 2^28. */
export const mostRows = 268435455;
/** By which entries (i, j) and (j, i) of Q may differ: of the geometric mean of the largest entries of rows and columns
 * i and j; products of matrices leave that, relative. */
export const symmetry = 1e-12;
