/* Provides the C interface of Marble: core and client behind one shared library.
 *
 *   min 1/2 z'Qz + g'z + c0   s.t.   A z + b = 0,   C z + d >= 0,   0 <= L z + l  _|_  R z + r >= 0
 *
 * A function that can fail returns MARBLE_OK or an error code and fills `error`, which may be NULL. No
 * function throws or aborts. A NULL that is not allowed is MARBLE_INVALID_ARGUMENT and names the parameter. A
 * failed call changes nothing. Destroying NULL has no effect. A function writes the object that it creates to
 * its last parameter but one, NULL on failure; borrowed arrays are NULL with count 0 on failure. No count
 * exceeds 2147483647.
 *
 * Threads: a client is thread-safe, and marble_call_cancel may be called at any time. Every other handle
 * belongs to one thread at a time; several threads may read a handle that no one changes. Changing a problem,
 * a call or a session that another call uses is MARBLE_FAILED_PRECONDITION, also in a progress function.
 */
#pragma once

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Version of this header. It rises, with the library's soname, when programs must be recompiled. */
#define MARBLE_ABI_VERSION 1
/* Returns the version of the loaded library. */
int32_t marble_abi_version(void);
/* Returns major, minor and patch version of the library. */
const char* marble_version(void);

/* clang-format off */
/* Made by proto/generate from contract.def, up to the line that ends it; not to be edited. */
enum marble_error_code {
  MARBLE_OK = 0,
  MARBLE_CANCELLED = 1, /* The caller cancelled it, or it was ended before it had a result. */
  MARBLE_INVALID_ARGUMENT = 3, /* The input breaks a documented rule; field and index show where. */
  MARBLE_DEADLINE_EXCEEDED = 4, /* Its deadline passed before it had a result. */
  MARBLE_NOT_FOUND = 5, /* The named object does not exist, or is no longer kept. */
  MARBLE_PERMISSION_DENIED = 7, /* The caller lacks the required role or priority. */
  MARBLE_RESOURCE_EXHAUSTED = 8, /* A limit of the server or a quota of the client was reached. */
  MARBLE_FAILED_PRECONDITION = 9, /* The request does not fit the current state: an update with other sizes, a result that does not exist yet. */
  MARBLE_ABORTED = 10, /* The server ended it by one of its rules: a session had no update for too long. */
  MARBLE_INTERNAL = 13, /* A bug in Marble. */
  MARBLE_UNAVAILABLE = 14, /* The server cannot be reached, is draining, or is not a Marble server. */
  MARBLE_UNAUTHENTICATED = 16, /* The caller presented no valid token or certificate. */
};
enum marble_status {
  MARBLE_STATUS_SOLVED = 0, /* All tolerances are met. */
  MARBLE_STATUS_ALMOST_SOLVED = 1, /* Feasible to 100 times the tolerances, but no further progress was possible. */
  MARBLE_STATUS_ITERATION_LIMIT = 2, /* max_iterations was reached, or with option global_search node_limit; this is the best iterate. */
  MARBLE_STATUS_TIME_LIMIT = 3, /* time_limit_s was reached; this is the best iterate. */
  MARBLE_STATUS_CANCELLED = 4, /* The solve was cancelled by its client, by a cancel call or by a server that shuts down; this is the best iterate. */
  MARBLE_STATUS_INFEASIBLE = 5, /* No point meets the constraints. The certificate proves it even without complementarity; if it is empty, every branch of the pairs was refuted. */
  MARBLE_STATUS_LOCALLY_INFEASIBLE = 6, /* The search ended at a point where the violation cannot be lowered any further; no feasible point is near. One may exist elsewhere. */
  MARBLE_STATUS_UNBOUNDED = 7, /* The objective falls without end along a feasible direction, which is the certificate. */
  MARBLE_STATUS_NUMERICAL_FAILURE = 8, /* No acceptable step was found within the bounded number of tries. */
};
/* The end of what is made. */
/* clang-format on */

/* What was wrong, where, and the violated rule. Texts end with a zero byte; longer ones are truncated. */
typedef struct marble_error {
  int32_t code;      /* MARBLE_OK, or one of marble_error_code */
  int32_t reserved;  /* 0 */
  int64_t index;     /* position in the field, from 0; -1 for the field as a whole */
  char field[128];   /* such as "A.row_indices"; empty if there is none */
  char value[64];    /* the invalid value, such as "nan"; may be empty */
  char bound[512];   /* the rule: "must be in [0, 12)" */
  char message[768]; /* the whole error in one line */
} marble_error;

/* Returns the name, such as "invalid_argument"; "unknown" for other numbers. */
const char* marble_error_name(int32_t code);
/* Returns the name, such as "solved"; "unknown" for other numbers. */
const char* marble_status_name(int32_t status);
/* Returns what to try after a solve with this status; empty if there is nothing to improve. */
const char* marble_status_advice(int32_t status);

/* A problem: owns copies of its data. */
typedef struct marble_problem marble_problem;
/* Creates a problem with n >= 0 variables; all parts are zero or absent. */
int32_t marble_problem_create(int32_t variables, marble_problem** problem, marble_error* error);
/* Reads a file, JSON or binary; "-" is standard input. */
int32_t marble_problem_read(const char* path, marble_problem** problem, marble_error* error);
void marble_problem_destroy(marble_problem* problem);
int32_t marble_problem_variables(const marble_problem* problem); /* n; 0 for NULL */
int32_t marble_problem_pairs(const marble_problem* problem);     /* n_c; 0 for NULL */
/* Sets a vector. `part` is "g" (n), "b", "d", "l", "r" (as many as the matrix has rows) or "c0" (1). `values`
 * may be NULL if count is 0. marble_problem_check and every solve check sizes and numbers. */
int32_t marble_problem_set_vector(marble_problem* problem, const char* part, const double* values,
                                  int64_t count, marble_error* error);
/* Sets a matrix. `part` is "Q" (n x n, both triangles, symmetric up to rounding), "A", "C", "L" or "R".
 * Compressed columns: column_pointers has columns + 1 entries from 0 to `entries`, row_indices and values
 * have `entries`, rows ascend within a column. rows, columns and entries are >= 0. */
int32_t marble_problem_set_matrix(marble_problem* problem, const char* part, int32_t rows, int32_t columns,
                                  const int32_t* column_pointers, int64_t entries, const int32_t* row_indices,
                                  const double* values, marble_error* error);
/* Checks the problem and reports the first error: field, index, value and bound. */
int32_t marble_problem_check(const marble_problem* problem, marble_error* error);

/* The solver's options by their names, with their defaults unless set. */
typedef struct marble_options marble_options;
int32_t marble_options_create(marble_options** options, marble_error* error);
void marble_options_destroy(marble_options* options);
/* Sets an option as on a command line: "1e-6", "true", "paper". */
int32_t marble_options_set(marble_options* options, const char* name, const char* text, marble_error* error);
/* Sets an option by number; booleans are 0 and 1, choices count from 0. */
int32_t marble_options_set_number(marble_options* options, const char* name, double value,
                                  marble_error* error);
int32_t marble_options_get(const marble_options* options, const char* name, double* value,
                           marble_error* error);

/* One row of the iteration table. Later versions may append to it. */
typedef struct marble_progress {
  int32_t iteration;
  int32_t outer_iteration;
  int32_t factorizations;
  int32_t reserved; /* 0 */
  double objective;
  double equality_violation; /* violations in the user's units */
  double inequality_violation;
  double complementarity_violation;
  double kkt_residual;
  double kappa;
  double rho;
  double step_length;
  double regularization;
  double elapsed_s;
  double incumbent; /* +infinity while there is none */
  double bound;     /* -infinity while there is none */
  double gap;       /* +infinity while there is none */
  int64_t nodes;
  int64_t open_nodes;
} marble_progress;
/* Called after every iteration, on the thread that solves; must not block, and must not destroy objects in
 * use. Any return value but 0 cancels the call, as marble_call_cancel does. */
typedef int (*marble_progress_function)(const marble_progress* progress, void* user);

typedef struct marble_solution marble_solution; /* a solution: see below */

/* Options of calls; reusable, by one call at a time. */
typedef struct marble_call marble_call;
int32_t marble_call_create(marble_call** call, marble_error* error);
void marble_call_destroy(marble_call* call);
/* NULL: no progress is reported. */
int32_t marble_call_set_progress(marble_call* call, marble_progress_function function, void* user,
                                 marble_error* error);
/* Sets the start: n numbers, or none with count 0. */
int32_t marble_call_set_initial_z(marble_call* call, const double* z, int64_t count, marble_error* error);
/* Sets a solution of this or a similar problem with the same sizes, whose branch is tried first; it is
 * copied. NULL: none. Sessions start from their own solutions and accept none. */
int32_t marble_call_set_warm_start(marble_call* call, const marble_solution* start, marble_error* error);
/* Sets the deadline in seconds after the start of a call (>= 0); infinity: none. */
int32_t marble_call_set_deadline(marble_call* call, double seconds, marble_error* error);
/* Makes sessions opened with this call survive their server: if it is lost, a solve opens the session again,
 * on another server if the address lists several. It tries for this many seconds (>= 0), but at most until
 * the deadline. It starts from the last z, and its solution has the number "reopened". 0, the default: the
 * session ends. */
int32_t marble_call_set_reopen(marble_call* call, double seconds, marble_error* error);
/* Sets how long the solves of sessions opened with this call wait for an answer after their deadline, in
 * [0, 3600] s; default 0.1: the way of an answer, which the server sends before the deadline. Then the solve
 * returns MARBLE_DEADLINE_EXCEEDED; the session continues, and discards the answer if it comes later. */
int32_t marble_call_set_answer_grace(marble_call* call, double seconds, marble_error* error);
/* Sets the priority on a busy server: "by_method" (the default), "realtime", "interactive" or "batch". */
int32_t marble_call_set_priority(marble_call* call, const char* priority, marble_error* error);
/* Sets the caller's own id for the server's log: at most 128 bytes of printable ASCII, empty for none. A job
 * submitted twice with the same id is one job. */
int32_t marble_call_set_request_id(marble_call* call, const char* request_id, marble_error* error);
/* Requests derivatives with each solution, on its branch: rows at zero stay at zero. marble_solution_change
 * and the functions after it return them. Errors in the request are reported by the solve.
 *
 * Directions: new numbers minus the old ones. `part` is a letter of the equation, g, b, d, l, r, Q, A, C, L
 * or R, with values in the order of marble_problem_set_matrix; `values` has those of all directions, one
 * after the other; unset parts are zero. Another number of directions resets the parts; 0 requests none, and
 * `part` may then be NULL. */
int32_t marble_call_set_directions(marble_call* call, int32_t directions, const char* part,
                                   const double* values, int64_t count, marble_error* error);
/* Losses: their derivatives with respect to `vector`, which is z, y, nu, xi or eta; the rest as for
 * directions. */
int32_t marble_call_set_losses(marble_call* call, int32_t losses, const char* vector, const double* values,
                               int64_t count, marble_error* error);
/* Requests the response of rows E z, m x n, to a price: with the cost mu'E z added the branch has
 * E z = free - response mu and the point z - columns mu. `report_columns` other than 0 requests the last two.
 * The pattern is as in marble_problem_set_matrix; rows = 0 requests none, and the rest may then be NULL. */
int32_t marble_call_set_rows(marble_call* call, int32_t rows, int32_t columns, const int32_t* column_pointers,
                             int64_t entries, const int32_t* row_indices, const double* values,
                             int32_t report_columns, marble_error* error);
/* Vectors for the rows: "proximal", a diagonal >= 0 that was added to Q and is excluded here, at the cost of
 * one more factorization; "g", the linear cost of free and z instead of the problem's. n numbers, or none. */
int32_t marble_call_set_rows_vector(marble_call* call, const char* name, const double* values, int64_t count,
                                    marble_error* error);
/* Ends the running call and later ones with MARBLE_CANCELLED, until marble_call_reset. Any thread may call
 * it. */
void marble_call_cancel(marble_call* call);
int32_t marble_call_reset(marble_call* call, marble_error* error);

/* A connection to a server, or this process. */
typedef struct marble_client marble_client;
/* Connects to "host:port", a comma-separated list of them, "unix:PATH", or "local": this process. NULL: the
 * server that MARBLE_SERVER names, or this process if it is unset. Uses MARBLE_TOKEN, MARBLE_TLS_CA,
 * MARBLE_TLS_CERTIFICATE and MARBLE_TLS_KEY. */
int32_t marble_client_connect(const char* address, marble_client** client, marble_error* error);
/* The same for control loops: if the server disappears, an update that does not arrive is noticed in 1 s and
 * silence in 12 s, instead of 15 and 45. */
int32_t marble_client_connect_for_control(const char* address, marble_client** client, marble_error* error);
void marble_client_destroy(marble_client* client);
const char* marble_client_address(
    const marble_client* client); /* "in process" without a server; empty for NULL */

/* A solution, solved or not. Borrowed arrays live as long as it does. */
/* Solves a problem. `client`, `options` and `call` may be NULL: the server of MARBLE_SERVER, defaults, no
 * options. */
int32_t marble_solve(const marble_client* client, const marble_problem* problem,
                     const marble_options* options, marble_call* call, marble_solution** solution,
                     marble_error* error);
void marble_solution_destroy(marble_solution* solution);
int32_t marble_solution_status(const marble_solution* solution);     /* a marble_status; -1 for NULL */
const char* marble_solution_detail(const marble_solution* solution); /* one sentence; empty for NULL */
double marble_solution_objective(const marble_solution* solution);   /* NaN for NULL */
/* Borrows, without a copy: "z" (n), "y" (of A), "nu" (of C), "xi" and "eta" (of L and R), "certificate" (may
 * be empty), with Qz + g + A'y - C'nu - L'xi - R'eta = 0. */
int32_t marble_solution_vector(const marble_solution* solution, const char* name, const double** values,
                               int64_t* count, marble_error* error);
/* Returns a number, by the name of a number, flag or enumeration of marble.v1.Solution (solution.proto), such
 * as objective, bound, gap, proved, nodes, iterations, factorizations, kkt_residual, b_stationary (NaN if
 * that was not decided), stationarity (0 unknown, 1 weak to 4 strong), second_order (0 unknown, 1 saddle, 2
 * necessary, 3 minimum, 4 convex) and origin (0 this solve, 1 the session's solution before it). A bound that
 * is not known is -infinity, a gap infinity. Also: equality_violation, inequality_violation,
 * complementarity_violation, reopened (1 if its session was opened again for it, else 0), conflict (with
 * option explain: 0 none, 1 not minimal because a limit came first, 2 minimal: without any one of its parts
 * the others have a common point), setup_s, solve_s, queue_s, total_s. */
int32_t marble_solution_number(const marble_solution* solution, const char* name, double* value,
                               marble_error* error);
/* Returns the names of all numbers, by an index from 0; empty for an index beyond the last, or below 0. */
const char* marble_solution_number_name(int32_t index);
/* With option explain: parts of an infeasible problem that no point satisfies together, whatever the other
 * parts are. `part` is "equalities" (rows of Az + b = 0), "inequalities" (rows of Cz + d >= 0), "left_sides"
 * or "right_sides" (pairs of which Lz + l >= 0 or Rz + r >= 0 is needed) or "complementarities" (pairs of
 * which one side must be zero). Indices are borrowed, ascend and count from 0; a part may be empty.
 * MARBLE_FAILED_PRECONDITION if there is no conflict: it was not requested, or the problem is not proved
 * infeasible. */
int32_t marble_solution_conflict(const marble_solution* solution, const char* part, const int32_t** indices,
                                 int64_t* count, marble_error* error);
/* Returns what was proved about the conflict, or which limit came first; empty without one, and for NULL. */
const char* marble_solution_conflict_detail(const marble_solution* solution);

/* The requested derivatives. MARBLE_FAILED_PRECONDITION explains why there are none: none were requested, the
 * solution is not solved or not an isolated exact solution of a branch, or the branch is flat along the
 * request. All arrays are borrowed, as above. Directions, losses, rows and pairs count from 0.
 *
 * Returns the change of z, y, nu, xi or eta per unit of a direction. */
int32_t marble_solution_change(const marble_solution* solution, int32_t direction, const char* name,
                               const double** values, int64_t* count, marble_error* error);
/* Returns 1 if the solution moves that way for small positive steps, which is always so without weak rows; 0
 * if it does not; -1 if there is no such change. */
int32_t marble_solution_active_set_constant(const marble_solution* solution, int32_t direction);
/* Returns the derivatives of a loss with respect to the numbers of a part: g, b, d, l, r, Q, A, C, L or R.
 * Upper entries of Q stand for both. */
int32_t marble_solution_gradient(const marble_solution* solution, int32_t loss, const char* part,
                                 const double** values, int64_t* count, marble_error* error);
/* Returns for the rows: "values", E z at the solution, and "free", m; "response", its upper triangle by
 * columns, m (m + 1) / 2; "z", n, and "columns", n m by columns, or nothing. */
int32_t marble_solution_response(const marble_solution* solution, const char* name, const double** values,
                                 int64_t* count, marble_error* error);
/* Returns the rows for which derivatives are one-sided: "inequalities" at zero with a multiplier of zero,
 * "pairs" with both sides at zero that may leave by either. */
int32_t marble_solution_weak(const marble_solution* solution, const char* name, const int32_t** indices,
                             int64_t* count, marble_error* error);

/* Jobs of one server outlive the program that submitted them. MARBLE_NOT_FOUND: unknown, no longer kept, or
 * not visible to the caller. `client` is as above. */
#define MARBLE_JOB_ID_SIZE 64 /* with its zero byte */
/* Submits a job. Of the call are used initial z, warm start, priority, request id, and for the submission
 * only its deadline. */
int32_t marble_job_submit(const marble_client* client, const marble_problem* problem,
                          const marble_options* options, marble_call* call, char job_id[MARBLE_JOB_ID_SIZE],
                          marble_error* error);
/* Returns "queued", "running", "finished" and such: a constant. */
int32_t marble_job_state(const marble_client* client, const char* job_id, const char** state,
                         marble_error* error);
/* Returns its solution, or the error it ended with. If `wait` is 0, an unfinished job is
 * MARBLE_FAILED_PRECONDITION. Of the call, which may be NULL, deadline and cancel apply to the wait only. */
int32_t marble_job_result(const marble_client* client, const char* job_id, int32_t wait, marble_call* call,
                          marble_solution** solution, marble_error* error);
/* Cancels a job: a waiting one at once, a running one within an iteration. */
int32_t marble_job_cancel(const marble_client* client, const char* job_id, marble_error* error);
/* Removes a job and its solution; cancels it if it has not finished. */
int32_t marble_job_remove(const marble_client* client, const char* job_id, marble_error* error);

/* Repeated solves of one problem: only changes are set, and each solve starts from the last solution. */
typedef struct marble_session marble_session;
/* Opens a session with the parameters of marble_solve. The call's initial_z is the start of the first solve;
 * cancelling the call ends the session. Its progress function, if any, is called for every solve; it and the
 * call must outlive the session. The derivatives that the call requests are returned with every solve. */
int32_t marble_session_open(const marble_client* client, const marble_problem* problem,
                            const marble_options* options, marble_call* call, marble_session** session,
                            marble_error* error);
void marble_session_destroy(marble_session* session);
/* Sets new numbers for the next solve: "c0", a vector, or all values of a matrix in their order. They are
 * checked here. */
int32_t marble_session_set(marble_session* session, const char* part, const double* values, int64_t count,
                           marble_error* error);
/* Applies from the next solve on; scaling_passes does not change. */
int32_t marble_session_set_options(marble_session* session, const marble_options* options,
                                   marble_error* error);
/* Sets the start of the next solve (n numbers), instead of the last solution. */
int32_t marble_session_set_initial_z(marble_session* session, const double* z, int64_t count,
                                     marble_error* error);
/* Makes the next solve discard the last solution. */
int32_t marble_session_set_cold(marble_session* session, marble_error* error);
/* Shifts the last solution by one stage before the next solve: all vectors consist of `stages` equal parts.
 */
int32_t marble_session_shift(marble_session* session, int32_t stages, marble_error* error);
/* Solves with the numbers that were set, and clears them. */
int32_t marble_session_solve(marble_session* session, marble_solution** solution, marble_error* error);

#ifdef __cplusplus
}
#endif
