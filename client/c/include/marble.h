/* The C interface of Marble: core and client behind one shared library.
 *
 *   min 1/2 z'Qz + g'z + c0   s.t.   A z + b = 0,   C z + d >= 0,   0 <= L z + l  _|_  R z + r >= 0
 *
 * What can fail returns MARBLE_OK or the code of its fault and fills `error`, which may be NULL. Nothing
 * throws, nothing aborts. NULL where it is not allowed is MARBLE_INVALID_ARGUMENT and names the parameter. A
 * fault changes nothing. Destroying NULL does nothing. What a function makes it writes to its last parameter
 * but one, NULL where it failed; lent numbers are NULL and 0 where it failed. No count is above 2147483647.
 * Threads: a client may be used by many at once, and marble_call_cancel at any time. Every other handle
 * belongs to one thread at a time; handles that are only read may be read by many. To change a problem, a
 * call or a session that another call uses is MARBLE_FAILED_PRECONDITION, in a progress function too.
 */
#pragma once

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Of this header. It rises, and the library's soname with it, where a program would have to be compiled anew.
 */
#define MARBLE_ABI_VERSION 1
/* Of the library that is loaded. */
int32_t marble_abi_version(void);
/* Major, minor, patch of the library. */
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
  MARBLE_STATUS_SOLVED_REDUCED = 1, /* Feasible to 100 times the tolerances, but no further progress was possible. */
  MARBLE_STATUS_ITERATION_LIMIT = 2, /* max_iterations was reached, or with option global node_limit; this is the best iterate. */
  MARBLE_STATUS_TIME_LIMIT = 3, /* time_limit_s was reached; this is the best iterate. */
  MARBLE_STATUS_CANCELLED = 4, /* The solve was cancelled by its client, by a cancel call or by a server that shuts down; this is the best iterate. */
  MARBLE_STATUS_INFEASIBLE = 5, /* No point meets the constraints. The certificate proves it even without complementarity; if it is empty, every branch of the pairs was refuted. */
  MARBLE_STATUS_LOCALLY_INFEASIBLE = 6, /* The search ended at a point where the violation cannot be lowered any further; no feasible point is near. One may exist elsewhere. */
  MARBLE_STATUS_UNBOUNDED = 7, /* The objective falls without end along a feasible direction, which is the certificate. */
  MARBLE_STATUS_NUMERICAL_FAILURE = 8, /* No acceptable step was found within the bounded number of tries. */
};
/* The end of what is made. */
/* clang-format on */

/* What was wrong, where, and the rule it broke. Texts end with a zero byte; what is longer is cut off. */
typedef struct marble_error {
  int32_t code;      /* MARBLE_OK, or one of marble_error_code */
  int32_t reserved;  /* 0 */
  int64_t index;     /* position in the field, from 0; -1 where the field as a whole is meant */
  char field[128];   /* as "A.row_indices"; empty where there is none */
  char value[64];    /* the value that is wrong, as "nan"; may be empty */
  char bound[512];   /* the rule: "must be in [0, 12)" */
  char message[768]; /* all of it in one line */
} marble_error;

/* "invalid_argument"; "unknown" of no code. */
const char* marble_error_name(int32_t code);
/* "solved"; "unknown" of no status. */
const char* marble_status_name(int32_t status);
/* What to try after a solve that ended so; empty where there is nothing to mend. */
const char* marble_status_advice(int32_t status);

/* A problem: owns copies of what it is given. */
typedef struct marble_problem marble_problem;
/* n >= 0 variables, all parts zero or absent. */
int32_t marble_problem_create(int32_t variables, marble_problem** problem, marble_error* error);
/* A file, JSON or binary: "-" is standard input. */
int32_t marble_problem_read(const char* path, marble_problem** problem, marble_error* error);
void marble_problem_destroy(marble_problem* problem);
int32_t marble_problem_variables(const marble_problem* problem); /* n; 0 of NULL */
int32_t marble_problem_pairs(const marble_problem* problem);     /* n_c; 0 of NULL */
/* `part` is "g" (n), "b", "d", "l", "r" (as many as the matrix has rows) or "c0" (1). `values` may be NULL
 * where count is 0. Sizes and numbers are checked by marble_problem_check and by all that solves. */
int32_t marble_problem_set_vector(marble_problem* problem, const char* part, const double* values,
                                  int64_t count, marble_error* error);
/* `part` is "Q" (n x n, both triangles, symmetric but for rounding), "A", "C", "L" or "R"; compressed
 * columns: column_pointers has columns + 1 entries from 0 to `entries`, row_indices and values have
 * `entries`, rows ascend within a column. rows, columns and entries are >= 0. */
int32_t marble_problem_set_matrix(marble_problem* problem, const char* part, int32_t rows, int32_t columns,
                                  const int32_t* column_pointers, int64_t entries, const int32_t* row_indices,
                                  const double* values, marble_error* error);
/* The first fault: field, index, value and bound. */
int32_t marble_problem_check(const marble_problem* problem, marble_error* error);

/* The solver's options by their names, at their defaults unless set. */
typedef struct marble_options marble_options;
int32_t marble_options_create(marble_options** options, marble_error* error);
void marble_options_destroy(marble_options* options);
/* As on a command line: "1e-6", "true", "paper". */
int32_t marble_options_set(marble_options* options, const char* name, const char* text, marble_error* error);
/* A number; booleans are 0 and 1, choices count from 0. */
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
/* Told after every iteration, on the thread that solves; must not block, and must not destroy what is in use.
 * Whoever returns anything but 0 gives the call up, as marble_call_cancel does. */
typedef int (*marble_progress_function)(const marble_progress* progress, void* user);

typedef struct marble_solution marble_solution; /* an answer: below */

/* What accompanies calls; may be used again, and by one call at a time. */
typedef struct marble_call marble_call;
int32_t marble_call_create(marble_call** call, marble_error* error);
void marble_call_destroy(marble_call* call);
/* NULL tells nobody. */
int32_t marble_call_set_progress(marble_call* call, marble_progress_function function, void* user,
                                 marble_error* error);
/* Where to start: n numbers, or none with count 0. */
int32_t marble_call_set_initial_z(marble_call* call, const double* z, int64_t count, marble_error* error);
/* An answer to this problem or one like it, of the same sizes, whose branch is tried first; it is copied.
 * NULL: none. Sessions start from their own answers, and take none. */
int32_t marble_call_set_warm_start(marble_call* call, const marble_solution* start, marble_error* error);
/* No answer is wanted later than so many seconds after a call began (>= 0); infinity: whenever. */
int32_t marble_call_set_deadline(marble_call* call, double seconds, marble_error* error);
/* A session that is opened with it outlives its server: where that is lost, a solve sets it up again, on
 * another server where the address has several, and tries for so many seconds (>= 0), but no longer than the
 * deadline. It starts from the last z, and its answer has the number "reopened". 0, the default: it ends. */
int32_t marble_call_set_reopen(marble_call* call, double seconds, marble_error* error);
/* Whose turn it is on a busy server: "by_method" (the default), "realtime", "interactive" or "batch". */
int32_t marble_call_set_priority(marble_call* call, const char* priority, marble_error* error);
/* The caller's own id of what it asks for, for the server's log: at most 128 bytes of printable ASCII, empty
 * for none. A job that is submitted twice with it is one job. */
int32_t marble_call_set_request_id(marble_call* call, const char* request_id, marble_error* error);
/* Derivatives that are wanted with each answer, of its branch: rows at zero stay there.
 * marble_solution_change and those after it tell them. What is wrong with them the solve says.
 *
 * Directions: new numbers less the old ones. `part` is a letter of the equation, g, b, d, l, r, Q, A, C, L or
 * R, whose values are in the order of marble_problem_set_matrix; `values` are those of all directions, one
 * after the other, and what is not set is zero. Another number of directions forgets the parts; 0 asks for
 * none, and `part` may be NULL. */
int32_t marble_call_set_directions(marble_call* call, int32_t directions, const char* part,
                                   const double* values, int64_t count, marble_error* error);
/* Losses: their derivatives by `vector`, which is z, y, nu, xi or eta; else as directions. */
int32_t marble_call_set_losses(marble_call* call, int32_t losses, const char* vector, const double* values,
                               int64_t count, marble_error* error);
/* Rows E z, m x n, whose response to a price is wanted: with the cost mu'E z added the branch has
 * E z = free - response mu and the point z - columns mu. `tell_columns` other than 0 asks for the last two.
 * The pattern is as in marble_problem_set_matrix; with rows = 0 none are wanted, and the rest may be NULL. */
int32_t marble_call_set_rows(marble_call* call, int32_t rows, int32_t columns, const int32_t* column_pointers,
                             int64_t entries, const int32_t* row_indices, const double* values,
                             int32_t tell_columns, marble_error* error);
/* Of the rows: "proximal", a diagonal >= 0 that was added to Q and is left out here, for one more
 * factorization; "g", the linear cost of free and z in place of the problem's own. n numbers, or none. */
int32_t marble_call_set_rows_vector(marble_call* call, const char* name, const double* values, int64_t count,
                                    marble_error* error);
/* What goes on with it and what comes ends with MARBLE_CANCELLED, until marble_call_reset. Any thread may
 * ask. */
void marble_call_cancel(marble_call* call);
int32_t marble_call_reset(marble_call* call, marble_error* error);

/* A connection to a server, or this process. */
typedef struct marble_client marble_client;
/* "host:port", several with commas, "unix:PATH", or "local": this process. NULL is where MARBLE_SERVER says,
 * and this process where it says nothing. MARBLE_TOKEN, MARBLE_TLS_CA, MARBLE_TLS_CERTIFICATE and
 * MARBLE_TLS_KEY count. */
int32_t marble_client_connect(const char* address, marble_client** client, marble_error* error);
/* The same for control loops: of a server that is gone without a word an update that does not arrive is
 * noticed in 1 s and silence in 12 s, in place of 15 and 45. */
int32_t marble_client_connect_for_control(const char* address, marble_client** client, marble_error* error);
void marble_client_destroy(marble_client* client);
const char* marble_client_address(
    const marble_client* client); /* "in process" without a server; empty of NULL */

/* The answer, solved or not. All it lends lives as long as it. */
/* `client`, `options` and `call` may be NULL: where MARBLE_SERVER says, the defaults, and nothing. */
int32_t marble_solve(const marble_client* client, const marble_problem* problem,
                     const marble_options* options, marble_call* call, marble_solution** solution,
                     marble_error* error);
void marble_solution_destroy(marble_solution* solution);
int32_t marble_solution_status(const marble_solution* solution);     /* a marble_status; -1 of NULL */
const char* marble_solution_detail(const marble_solution* solution); /* one sentence; empty of NULL */
double marble_solution_objective(const marble_solution* solution);   /* NaN of NULL */
/* Lent, not copied: "z" (n), "y" (of A), "nu" (of C), "xi" and "eta" (of L and R), "certificate" (maybe
 * none), with Qz + g + A'y - C'nu - L'xi - R'eta = 0. */
int32_t marble_solution_vector(const marble_solution* solution, const char* name, const double** values,
                               int64_t* count, marble_error* error);
/* objective, bound, gap, proved, nodes, open_nodes, iterations, factorizations, kkt_residual,
 * equality_violation, inequality_violation, complementarity_violation, stationarity (0 unknown, 1 weak to 4
 * strong), second_order (0 unknown, 1 saddle, 2 necessary, 3 minimum, 4 convex), origin (0 this solve, 1 the
 * session's solution before it), reopened (1 where its session was set up again for it, else 0), conflict (of
 * option explain: 0 none, 1 of which fewer parts may conflict already, as a limit came first, 2 minimal:
 * without any one of its parts the others have a point), setup_s, solve_s, queue_s, total_s. */
int32_t marble_solution_number(const marble_solution* solution, const char* name, double* value,
                               marble_error* error);
/* Of option explain: parts of an infeasible problem that no point meets together, whatever the others are.
 * `part` is "equalities" (rows of Az + b = 0), "inequalities" (rows of Cz + d >= 0), "left_sides" or
 * "right_sides" (pairs of which Lz + l >= 0 or Rz + r >= 0 is needed) or "complementarities" (pairs of which
 * one side must be zero). Indices are lent, ascend and count from 0; a part may have none.
 * MARBLE_FAILED_PRECONDITION where there is no conflict: it was not asked for, or the problem is not proved
 * infeasible. */
int32_t marble_solution_conflict(const marble_solution* solution, const char* part, const int32_t** indices,
                                 int64_t* count, marble_error* error);
/* What was proved of the conflict, or which limit came first; empty without one, and of NULL. */
const char* marble_solution_conflict_detail(const marble_solution* solution);

/* The derivatives that the call asked for. MARBLE_FAILED_PRECONDITION says why there are none: nothing was
 * asked for, the answer is not solved or no isolated exact solution of a branch, or the branch is flat along
 * what was asked. All is lent, as above. Directions, losses, rows and pairs count from 0.
 *
 * How z, y, nu, xi or eta change by one unit of a direction. */
int32_t marble_solution_change(const marble_solution* solution, int32_t direction, const char* name,
                               const double** values, int64_t* count, marble_error* error);
/* 1 where the answer goes that way for small positive steps, as it always does without weak rows; 0 where it
 * does not; -1 where there is no such change. */
int32_t marble_solution_holds(const marble_solution* solution, int32_t direction);
/* The derivatives of a loss by the numbers of a part: g, b, d, l, r, Q, A, C, L or R. Of Q upper entries
 * stand for both. */
int32_t marble_solution_gradient(const marble_solution* solution, int32_t loss, const char* part,
                                 const double** values, int64_t* count, marble_error* error);
/* Of the rows: "values", E z at the answer, and "free", m; "response", its upper triangle by columns,
 * m (m + 1) / 2; "z", n, and "columns", n m by columns, or nothing. */
int32_t marble_solution_response(const marble_solution* solution, const char* name, const double** values,
                                 int64_t* count, marble_error* error);
/* Where derivatives hold one way alone, by which rows: "inequalities" at zero with a multiplier of zero,
 * "pairs" with both sides at zero that may leave by either. */
int32_t marble_solution_weak(const marble_solution* solution, const char* name, const int32_t** indices,
                             int64_t* count, marble_error* error);

/* Jobs of one server outlive the program that submitted them. MARBLE_NOT_FOUND: never heard of it, no longer
 * kept, or not the caller's to see. `client` is as above. */
#define MARBLE_JOB_ID_SIZE 64 /* with its zero byte */
/* Queues it. Of the call count initial z, warm start, priority, request id, and of the submission alone its
 * deadline. */
int32_t marble_job_submit(const marble_client* client, const marble_problem* problem,
                          const marble_options* options, marble_call* call, char job_id[MARBLE_JOB_ID_SIZE],
                          marble_error* error);
/* "queued", "running", "finished" and such: a constant. */
int32_t marble_job_state(const marble_client* client, const char* job_id, const char** state,
                         marble_error* error);
/* Its answer, or the fault it ended with. Unless `wait` is other than 0 a job that has not finished is
 * MARBLE_FAILED_PRECONDITION. Of the call, which may be NULL, count deadline and cancel: of the waiting
 * alone. */
int32_t marble_job_result(const marble_client* client, const char* job_id, int32_t wait, marble_call* call,
                          marble_solution** solution, marble_error* error);
/* Ends it: a waiting one at once, a running one within an iteration. */
int32_t marble_job_cancel(const marble_client* client, const char* job_id, marble_error* error);
/* Lets it and its answer go; ends it if it has not finished. */
int32_t marble_job_remove(const marble_client* client, const char* job_id, marble_error* error);

/* One problem again and again: only what changed is set, each solve starts from the last answer. */
typedef struct marble_session marble_session;
/* As marble_solve. The call's initial_z is where the first solve starts; to cancel it ends the session. Its
 * function, if it has one, is told of every solve; it and the call must outlive the session. The derivatives
 * that the call asks for come with every solve. */
int32_t marble_session_open(const marble_client* client, const marble_problem* problem,
                            const marble_options* options, marble_call* call, marble_session** session,
                            marble_error* error);
void marble_session_destroy(marble_session* session);
/* New numbers for the next solve: "c0", a vector, or all values of a matrix in their order. They are checked
 * here. */
int32_t marble_session_set(marble_session* session, const char* part, const double* values, int64_t count,
                           marble_error* error);
/* From the next solve on; scaling_passes stays. */
int32_t marble_session_set_options(marble_session* session, const marble_options* options,
                                   marble_error* error);
/* The next solve starts here (n numbers) instead of at the last answer. */
int32_t marble_session_set_initial_z(marble_session* session, const double* z, int64_t count,
                                     marble_error* error);
/* The next solve forgets the last answer. */
int32_t marble_session_set_cold(marble_session* session, marble_error* error);
/* The last answer moves one stage on before the next solve: all vectors hold `stages` equal parts. */
int32_t marble_session_shift(marble_session* session, int32_t stages, marble_error* error);
/* Takes what was set, and forgets that it was. */
int32_t marble_session_solve(marble_session* session, marble_solution** solution, marble_error* error);

#ifdef __cplusplus
}
#endif
