/* The C interface as a C program sees it: answers, faults with field, index and bound, sessions, two threads. */
#include <marble.h>

#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "check.h"

/* min z0^2 - 2 z0 + z1^2 - 4 z1, 0 <= z0 _|_ z1 >= 0: -4 at (0, 2). */
static marble_problem* first(void) {
  const int32_t diagonal[] = {0, 1, 2}, rows[] = {0, 1}, left[] = {0, 1, 1}, right[] = {0, 0, 1}, row[] = {0};
  const double twos[] = {2, 2}, one[] = {1}, zero[] = {0}, g[] = {-2, -4};
  marble_problem* problem = NULL;
  CHECK(marble_problem_create(2, &problem, NULL) == MARBLE_OK);
  CHECK(marble_problem_set_vector(problem, "g", g, 2, NULL) == MARBLE_OK);
  CHECK(marble_problem_set_matrix(problem, "Q", 2, 2, diagonal, 2, rows, twos, NULL) == MARBLE_OK);
  CHECK(marble_problem_set_matrix(problem, "L", 1, 2, left, 1, row, one, NULL) == MARBLE_OK);
  CHECK(marble_problem_set_matrix(problem, "R", 1, 2, right, 1, row, one, NULL) == MARBLE_OK);
  CHECK(marble_problem_set_vector(problem, "l", zero, 1, NULL) == MARBLE_OK);
  CHECK(marble_problem_set_vector(problem, "r", zero, 1, NULL) == MARBLE_OK);
  CHECK(marble_problem_check(problem, NULL) == MARBLE_OK);
  CHECK(marble_problem_variables(problem) == 2 && marble_problem_pairs(problem) == 1);
  return problem;
}

static void every_number_has_a_name(const marble_solution* solution) {
  int32_t count = 0;
  int has_bound = 0;
  for (; marble_solution_number_name(count)[0] != '\0'; count++) {
    const char* name = marble_solution_number_name(count);
    double number = 0;
    CHECK(marble_solution_number(solution, name, &number, NULL) == MARBLE_OK);
    has_bound += strcmp(name, "bound") == 0;
  }
  CHECK(count > 20 && has_bound == 1);
  CHECK(marble_solution_number_name(-1)[0] == '\0' && marble_solution_number_name(INT32_MAX)[0] == '\0');
}

static void check_answer(const marble_solution* solution, double objective) {
  const double* z = NULL;
  int64_t count = 0;
  double number = 0;
  CHECK(marble_solution_status(solution) == MARBLE_STATUS_SOLVED);
  CHECK(strcmp(marble_status_name(marble_solution_status(solution)), "solved") == 0);
  CHECK(fabs(marble_solution_objective(solution) - objective) < 1e-9);
  CHECK(marble_solution_vector(solution, "z", &z, &count, NULL) == MARBLE_OK && count > 0 && z != NULL);
  CHECK(marble_solution_number(solution, "complementarity_violation", &number, NULL) == MARBLE_OK && number < 1e-9);
  every_number_has_a_name(solution);
}

static int count_rows(const marble_progress* progress, void* user) {
  CHECK(progress->factorizations >= 0);
  ++*(int*)user;
  return 0;
}

static int give_up(const marble_progress* progress, void* user) {
  (void)progress;
  (void)user;
  return 1;
}

static void an_answer_and_its_numbers_without_copies(const marble_client* client) {
  marble_problem* problem = first();
  marble_solution* solution = NULL;
  marble_error error;
  int rows = 0;
  marble_call* call = NULL;
  marble_options* options = NULL;
  double value = 0;
  const double *here = NULL, *again = NULL;
  int64_t count = 0;
  CHECK(marble_call_create(&call, NULL) == MARBLE_OK);
  CHECK(marble_options_create(&options, NULL) == MARBLE_OK);
  CHECK(marble_options_set(options, "path", "paper", NULL) == MARBLE_OK);
  CHECK(marble_options_get(options, "path", &value, NULL) == MARBLE_OK && value == 1);
  CHECK(marble_call_set_progress(call, count_rows, &rows, NULL) == MARBLE_OK);
  CHECK(marble_solve(client, problem, options, call, &solution, &error) == MARBLE_OK && error.code == MARBLE_OK);
  check_answer(solution, -4);
  CHECK(rows > 0);
  CHECK(marble_solution_vector(solution, "xi", &here, &count, NULL) == MARBLE_OK && count == 1);
  CHECK(marble_solution_vector(solution, "xi", &again, &count, NULL) == MARBLE_OK && here == again);
  marble_solution_destroy(solution);
  CHECK(marble_call_set_progress(call, give_up, NULL, NULL) == MARBLE_OK);
  CHECK(marble_solve(client, problem, options, call, &solution, &error) == MARBLE_CANCELLED);
  CHECK(solution == NULL && error.code == MARBLE_CANCELLED);
  CHECK(marble_call_set_progress(call, NULL, NULL, NULL) == MARBLE_OK);
  CHECK(marble_solve(client, problem, options, call, &solution, &error) == MARBLE_CANCELLED);
  CHECK(marble_call_reset(call, NULL) == MARBLE_OK);
  CHECK(marble_solve(client, problem, options, call, &solution, &error) == MARBLE_OK);
  marble_solution_destroy(solution);
  marble_options_destroy(options);
  marble_call_destroy(call);
  marble_problem_destroy(problem);
}

static void a_fault_names_field_index_value_and_bound(const marble_client* client) {
  marble_problem* problem = first();
  marble_solution* solution = NULL;
  marble_options* options = NULL;
  marble_call* call = NULL;
  marble_session* session = NULL;
  marble_error error;
  double value = 0;
  const int32_t diagonal[] = {0, 1, 2}, outside[] = {0, 7}, back[] = {0, 2, 1};
  const double twos[] = {2, 2}, bad[] = {-2, NAN}, three[] = {1, 2, 3};
  CHECK(marble_problem_set_matrix(problem, "Q", 2, 2, diagonal, 2, outside, twos, &error) == MARBLE_OK);
  CHECK(marble_solve(client, problem, NULL, NULL, &solution, &error) == MARBLE_INVALID_ARGUMENT && solution == NULL);
  CHECK(strcmp(error.field, "Q.row_indices") == 0 && error.index == 1 && strcmp(error.value, "7") == 0);
  CHECK(error.bound[0] != '\0' && strstr(error.message, "Q.row_indices[1]") != NULL);
  CHECK(marble_problem_set_matrix(problem, "Q", 2, 2, back, 2, outside, twos, &error) == MARBLE_OK);
  CHECK(marble_problem_check(problem, &error) == MARBLE_INVALID_ARGUMENT && strstr(error.field, "Q.") == error.field);
  CHECK(marble_problem_set_matrix(problem, "Q", 2, -2, diagonal, 2, outside, twos, &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(strcmp(error.field, "Q.columns") == 0 && strcmp(error.bound, "must be >= 0") == 0);
  CHECK(marble_problem_set_matrix(problem, "X", 2, 2, diagonal, 2, outside, twos, &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(strcmp(error.field, "part") == 0 && strcmp(error.value, "X") == 0);
  marble_problem_destroy(problem);

  problem = first();
  CHECK(marble_problem_set_vector(problem, "g", bad, 2, &error) == MARBLE_OK);
  CHECK(marble_problem_check(problem, &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(strcmp(error.field, "g") == 0 && error.index == 1 && strcmp(error.value, "nan") == 0);
  CHECK(marble_problem_set_vector(problem, "g", twos, 2, &error) == MARBLE_OK);
  CHECK(marble_problem_set_vector(problem, "r", three, 3, &error) == MARBLE_OK);
  CHECK(marble_problem_check(problem, &error) == MARBLE_INVALID_ARGUMENT && error.field[0] != '\0');
  CHECK(marble_problem_set_vector(problem, "g", NULL, 2, &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(strcmp(error.field, "values") == 0 && strcmp(error.bound, "must not be NULL") == 0);
  CHECK(marble_problem_set_vector(problem, "g", twos, -1, &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_problem_set_vector(problem, "c0", twos, 2, &error) == MARBLE_INVALID_ARGUMENT);
  marble_problem_destroy(problem);

  CHECK(marble_options_create(&options, NULL) == MARBLE_OK);
  CHECK(marble_options_set(options, "num_starts", "0", &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(strcmp(error.field, "num_starts") == 0 && strcmp(error.value, "0") == 0 && strstr(error.bound, "1000") != NULL);
  CHECK(marble_options_set(options, "nothing", "0", &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_options_set_number(options, "num_starts", NAN, &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_options_get(options, "nothing", &value, &error) == MARBLE_INVALID_ARGUMENT);
  marble_options_destroy(options);

  problem = first();
  CHECK(marble_call_create(&call, NULL) == MARBLE_OK);
  CHECK(marble_call_set_deadline(call, -1, &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_call_set_deadline(call, NAN, &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_call_set_reopen(call, -1, &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_call_set_answer_grace(call, -1, &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_call_set_answer_grace(call, 1e9, &error) == MARBLE_OK);
  CHECK(marble_session_open(client, problem, NULL, call, &session, &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(strcmp(error.field, "answer_grace") == 0 && session == NULL);
  CHECK(marble_call_set_initial_z(call, three, 3, &error) == MARBLE_OK);
  CHECK(marble_solve(client, problem, NULL, call, &solution, &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(strcmp(error.field, "initial_z") == 0);
  marble_call_destroy(call);
  marble_problem_destroy(problem);
  CHECK(marble_problem_read("/nowhere.json", &problem, &error) == MARBLE_NOT_FOUND && problem == NULL);
}

static void null_is_a_fault_and_never_a_crash(void) {
  marble_problem* problem = NULL;
  marble_solution* solution = NULL;
  marble_session* session = NULL;
  marble_error error;
  const double* values = NULL;
  int64_t count = 0;
  double number = 0;
  const int32_t none[] = {0};
  CHECK(marble_problem_create(1, NULL, &error) == MARBLE_INVALID_ARGUMENT && strcmp(error.field, "problem") == 0);
  CHECK(marble_problem_create(-1, &problem, &error) == MARBLE_INVALID_ARGUMENT && problem == NULL);
  CHECK(marble_problem_read(NULL, &problem, &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_problem_check(NULL, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_problem_set_vector(NULL, "g", &number, 1, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_problem_set_matrix(NULL, "Q", 0, 0, none, 0, NULL, NULL, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_options_create(NULL, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_options_set(NULL, "num_starts", "1", NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_options_set_number(NULL, "num_starts", 1, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_options_get(NULL, "num_starts", &number, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_call_create(NULL, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_call_set_progress(NULL, NULL, NULL, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_call_set_initial_z(NULL, NULL, 0, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_call_set_deadline(NULL, 1, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_call_reset(NULL, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_client_connect("local", NULL, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_client_connect_for_control("local", NULL, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_solve(NULL, NULL, NULL, NULL, &solution, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_solution_vector(NULL, "z", &values, &count, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_solution_number(NULL, "gap", &number, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_session_open(NULL, NULL, NULL, NULL, &session, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_session_set(NULL, "g", &number, 1, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_session_set_options(NULL, NULL, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_session_set_initial_z(NULL, NULL, 0, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_session_set_cold(NULL, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_session_shift(NULL, 1, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_session_solve(NULL, &solution, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_solution_status(NULL) == -1 && isnan(marble_solution_objective(NULL)));
  CHECK(marble_solution_detail(NULL)[0] == '\0' && marble_client_address(NULL)[0] == '\0');
  CHECK(marble_problem_variables(NULL) == 0 && marble_problem_pairs(NULL) == 0);
  problem = first();
  CHECK(marble_solve(NULL, problem, NULL, NULL, NULL, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_problem_set_matrix(problem, "Q", 1, 1, NULL, 0, NULL, NULL, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_problem_set_vector(problem, NULL, &number, 1, NULL) == MARBLE_INVALID_ARGUMENT);
  marble_problem_destroy(problem);
  marble_problem_destroy(NULL);
  marble_options_destroy(NULL);
  marble_call_destroy(NULL);
  marble_call_cancel(NULL);
  marble_client_destroy(NULL);
  marble_solution_destroy(NULL);
  marble_session_destroy(NULL);
  CHECK(strcmp(marble_error_name(-5), "unknown") == 0 && strcmp(marble_error_name(MARBLE_OK), "ok") == 0);
  CHECK(strcmp(marble_status_name(99), "unknown") == 0 && marble_status_advice(-1)[0] == '\0');
}

static void a_session_takes_what_changed_and_starts_warm(const marble_client* client) {
  marble_problem* problem = first();
  marble_session* session = NULL;
  marble_solution* solution = NULL;
  marble_options* options = NULL;
  marble_error error;
  const double g[] = {-8, -4}, bad[] = {1, INFINITY}, z[] = {4, 0}, c0 = 10, four[] = {4, 4};
  CHECK(marble_session_open(client, problem, NULL, NULL, &session, &error) == MARBLE_OK);
  marble_problem_destroy(problem);
  CHECK(marble_session_solve(session, &solution, &error) == MARBLE_OK);
  check_answer(solution, -4);
  marble_solution_destroy(solution);
  CHECK(marble_session_set(session, "g", bad, 2, &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(strcmp(error.field, "g") == 0 && error.index == 1 && strcmp(error.value, "inf") == 0);
  CHECK(marble_session_set(session, "g", g, 1, &error) == MARBLE_INVALID_ARGUMENT && strcmp(error.value, "1") == 0);
  CHECK(marble_session_set(session, "A", g, 1, &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_session_set(session, "k", g, 1, &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_session_set(session, "g", g, 2, &error) == MARBLE_OK);
  CHECK(marble_session_set(session, "c0", &c0, 1, &error) == MARBLE_OK);
  CHECK(marble_session_set_initial_z(session, z, 1, &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_session_set_initial_z(session, z, 2, &error) == MARBLE_OK);
  CHECK(marble_session_solve(session, &solution, &error) == MARBLE_OK);
  check_answer(solution, -6); /* -16 + 10 */
  marble_solution_destroy(solution);
  CHECK(marble_options_create(&options, NULL) == MARBLE_OK);
  CHECK(marble_options_set_number(options, "num_starts", 2, NULL) == MARBLE_OK);
  CHECK(marble_session_set_options(session, options, &error) == MARBLE_OK);
  CHECK(marble_session_set(session, "Q", four, 2, &error) == MARBLE_OK);
  CHECK(marble_session_set_cold(session, &error) == MARBLE_OK);
  CHECK(marble_session_shift(session, 3, &error) == MARBLE_INVALID_ARGUMENT && strcmp(error.field, "stages") == 0);
  CHECK(marble_session_shift(session, 1, &error) == MARBLE_OK);
  CHECK(marble_session_solve(session, &solution, &error) == MARBLE_OK);
  check_answer(solution, 2); /* -8 + 10 */
  marble_solution_destroy(solution);
  marble_options_destroy(options);
  marble_session_destroy(session);
}

/* Of a server that is there: C++ tests take one away. */
static void a_session_that_may_be_reopened_says_whether_it_was(const marble_client* client) {
  marble_problem* problem = first();
  marble_call* call = NULL;
  marble_session* session = NULL;
  marble_solution* solution = NULL;
  marble_error error;
  double number = NAN;
  CHECK(marble_call_create(&call, &error) == MARBLE_OK);
  CHECK(marble_call_set_reopen(call, 10, &error) == MARBLE_OK);
  CHECK(marble_session_open(client, problem, NULL, call, &session, &error) == MARBLE_OK);
  CHECK(marble_session_solve(session, &solution, &error) == MARBLE_OK);
  check_answer(solution, -4);
  CHECK(marble_solution_number(solution, "reopened", &number, &error) == MARBLE_OK && number == 0);
  CHECK(marble_solution_number(solution, "origin", &number, &error) == MARBLE_OK && number == 0);
  marble_solution_destroy(solution);
  marble_session_destroy(session);
  marble_call_destroy(call);
  marble_problem_destroy(problem);
}

/* A further start of the same problem is its answer after one factorization; so is one that was submitted. */
static void an_answer_is_started_from(const marble_client* client) {
  marble_problem* problem = first();
  marble_solution *cold = NULL, *warm = NULL;
  marble_call* call = NULL;
  marble_error error;
  double factorizations = 0;
  CHECK(marble_solve(client, problem, NULL, NULL, &cold, &error) == MARBLE_OK);
  CHECK(marble_call_create(&call, NULL) == MARBLE_OK);
  CHECK(marble_call_set_warm_start(NULL, cold, &error) == MARBLE_INVALID_ARGUMENT && strcmp(error.field, "call") == 0);
  CHECK(marble_call_set_warm_start(call, cold, &error) == MARBLE_OK);
  CHECK(marble_solve(client, problem, NULL, call, &warm, &error) == MARBLE_OK);
  check_answer(warm, -4);
  CHECK(marble_solution_number(warm, "factorizations", &factorizations, NULL) == MARBLE_OK && factorizations == 1);
  marble_solution_destroy(warm);
  marble_problem_destroy(problem);
  CHECK(marble_problem_create(3, &problem, NULL) == MARBLE_OK);
  CHECK(marble_problem_set_vector(problem, "g", (const double[]){1, 1, 1}, 3, NULL) == MARBLE_OK);
  CHECK(marble_solve(client, problem, NULL, call, &warm, &error) == MARBLE_INVALID_ARGUMENT && warm == NULL);
  CHECK(strcmp(error.field, "warm_start.z") == 0 && strcmp(error.bound, "must have 3 entries") == 0);
  CHECK(marble_call_set_warm_start(call, NULL, NULL) == MARBLE_OK);
  marble_call_destroy(call);
  marble_solution_destroy(cold);
  marble_problem_destroy(problem);
}

static int lists(const marble_solution* solution, const char* part, int64_t expected, int32_t first_index) {
  const int32_t* indices = NULL;
  int64_t count = -1;
  const int32_t code = marble_solution_conflict(solution, part, &indices, &count, NULL);
  return code == MARBLE_OK && count == expected && (expected == 0 || indices[0] == first_index);
}

/* z0 = 1 and z1 = 1 where z0 z1 = 0; z1 <= 3 can be met. */
static void an_infeasible_problem_is_explained(const marble_client* client) {
  const int32_t columns[] = {0, 1, 2}, both[] = {0, 1}, second[] = {0, 0, 1}, row[] = {0};
  marble_problem* problem = first();
  marble_options* options = NULL;
  marble_solution* solution = NULL;
  marble_error error;
  const int32_t* indices = both;
  int64_t count = 1;
  double number = -1;
  CHECK(marble_problem_set_matrix(problem, "A", 2, 2, columns, 2, both, (const double[]){1, 1}, NULL) == MARBLE_OK);
  CHECK(marble_problem_set_vector(problem, "b", (const double[]){-1, -1}, 2, NULL) == MARBLE_OK);
  CHECK(marble_problem_set_matrix(problem, "C", 1, 2, second, 1, row, (const double[]){-1}, NULL) == MARBLE_OK);
  CHECK(marble_problem_set_vector(problem, "d", (const double[]){3}, 1, NULL) == MARBLE_OK);
  CHECK(marble_solve(client, problem, NULL, NULL, &solution, &error) == MARBLE_OK);
  CHECK(marble_solution_conflict(solution, "equalities", &indices, &count, &error) == MARBLE_FAILED_PRECONDITION);
  CHECK(indices == NULL && count == 0 && strcmp(error.field, "solution") == 0);
  CHECK(marble_solution_number(solution, "conflict", &number, NULL) == MARBLE_OK && number == 0);
  CHECK(marble_solution_conflict_detail(solution)[0] == '\0' && marble_solution_conflict_detail(NULL)[0] == '\0');
  marble_solution_destroy(solution);
  CHECK(marble_options_create(&options, NULL) == MARBLE_OK);
  CHECK(marble_options_set(options, "explain", "true", NULL) == MARBLE_OK);
  CHECK(marble_solve(client, problem, options, NULL, &solution, &error) == MARBLE_OK);
  CHECK(marble_solution_status(solution) == MARBLE_STATUS_INFEASIBLE);
  CHECK(lists(solution, "equalities", 2, 0) && lists(solution, "complementarities", 1, 0));
  CHECK(lists(solution, "inequalities", 0, 0) && lists(solution, "left_sides", 0, 0));
  CHECK(lists(solution, "right_sides", 0, 0));
  CHECK(marble_solution_number(solution, "conflict", &number, NULL) == MARBLE_OK && number == 2);
  CHECK(marble_solution_conflict_detail(solution)[0] != '\0');
  CHECK(marble_solution_conflict(solution, "rows", &indices, &count, &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(strcmp(error.field, "part") == 0 && strcmp(error.value, "rows") == 0);
  marble_solution_destroy(solution);
  marble_options_destroy(options);
  marble_problem_destroy(problem);
}

/* Where the numbers lie is known once the call that lends them has been made. */
static void check_number(int32_t code, const double* const* values, const int64_t* count, int64_t at, double expected) {
  CHECK(code == MARBLE_OK && *values != NULL && at < *count);
  CHECK(code != MARBLE_OK || at >= *count || fabs((*values)[at] - expected) < 1e-9);
}

/* At (0, 2) z0 is held at zero and z1 is free: 2 z1 = 4 - g1. */
static void derivatives_come_with_answers(const marble_client* client) {
  marble_problem* problem = first();
  marble_solution* solution = NULL;
  marble_call* call = NULL;
  marble_session* session = NULL;
  marble_error error;
  const double *v = NULL, both[] = {0, 1, 1, 0}, l[] = {0, 3}, one[] = {1};
  const int32_t columns[] = {0, 0, 1}, row[] = {0}, *indices = NULL;
  int64_t count = 0;
  CHECK(marble_call_create(&call, NULL) == MARBLE_OK);
  CHECK(marble_solve(client, problem, NULL, call, &solution, NULL) == MARBLE_OK);
  CHECK(marble_solution_change(solution, 0, "z", &v, &count, &error) == MARBLE_FAILED_PRECONDITION);
  marble_solution_destroy(solution);
  CHECK(marble_call_set_directions(call, 2, "g", both, 4, NULL) == MARBLE_OK);
  CHECK(marble_call_set_directions(call, 2, "l", l, 2, NULL) == MARBLE_OK);
  CHECK(marble_call_set_losses(call, 1, "z", both, 2, NULL) == MARBLE_OK);
  CHECK(marble_call_set_rows(call, 1, 2, columns, 1, row, one, 1, NULL) == MARBLE_OK);
  CHECK(marble_call_set_directions(call, 2, "x", both, 4, &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(strcmp(error.field, "part") == 0 && strcmp(error.value, "x") == 0);
  CHECK(marble_session_open(client, problem, NULL, call, &session, NULL) == MARBLE_OK);
  for (int solve = 0; solve < 2; solve++) {
    CHECK((solve == 0 ? marble_solve(client, problem, NULL, call, &solution, &error)
                      : marble_session_solve(session, &solution, &error)) == MARBLE_OK);
    check_number(marble_solution_change(solution, 0, "z", &v, &count, NULL), &v, &count, 1, -0.5);
    check_number(marble_solution_change(solution, 1, "z", &v, &count, NULL), &v, &count, 0, -3);
    check_number(marble_solution_change(solution, 1, "xi", &v, &count, NULL), &v, &count, 0, -5);
    CHECK(marble_solution_active_set_constant(solution, 1) == 1 && marble_solution_active_set_constant(solution, 2) == -1);
    check_number(marble_solution_gradient(solution, 0, "g", &v, &count, NULL), &v, &count, 1, -0.5);
    check_number(marble_solution_gradient(solution, 0, "Q", &v, &count, NULL), &v, &count, 1, -1);
    check_number(marble_solution_response(solution, "response", &v, &count, NULL), &v, &count, 0, 0.5);
    check_number(marble_solution_response(solution, "columns", &v, &count, NULL), &v, &count, 1, 0.5);
    CHECK(marble_solution_weak(solution, "pairs", &indices, &count, NULL) == MARBLE_OK && count == 0);
    CHECK(marble_solution_gradient(solution, 1, "g", &v, &count, &error) == MARBLE_INVALID_ARGUMENT);
    CHECK(strcmp(error.field, "loss") == 0 && strcmp(error.bound, "must be in [0, 1)") == 0);
    marble_solution_destroy(solution);
  }
  marble_session_destroy(session);
  CHECK(marble_call_set_directions(call, 1, "b", both, 2, NULL) == MARBLE_OK);
  CHECK(marble_solve(client, problem, NULL, call, &solution, &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(strstr(error.field, "directions") != NULL);
  CHECK(marble_call_set_directions(call, 0, NULL, NULL, 0, NULL) == MARBLE_OK);
  CHECK(marble_call_set_losses(call, 0, NULL, NULL, 0, NULL) == MARBLE_OK);
  CHECK(marble_call_set_rows(call, 0, 0, NULL, 0, NULL, NULL, 0, NULL) == MARBLE_OK);
  CHECK(marble_solve(client, problem, NULL, call, &solution, NULL) == MARBLE_OK);
  CHECK(marble_solution_active_set_constant(solution, 0) == -1);
  CHECK(marble_solution_weak(NULL, "pairs", &indices, &count, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_call_set_losses(NULL, 1, "z", both, 2, NULL) == MARBLE_INVALID_ARGUMENT);
  CHECK(marble_call_set_rows(NULL, 0, 0, NULL, 0, NULL, NULL, 0, NULL) == MARBLE_INVALID_ARGUMENT);
  marble_solution_destroy(solution);
  marble_call_destroy(call);
  marble_problem_destroy(problem);
}

/* Only a server has jobs. */
static void a_job_is_submitted_and_its_answer_fetched(const marble_client* client) {
  const int server = strcmp(marble_client_address(client), "in process") != 0;
  marble_problem* problem = first();
  marble_solution* solution = NULL;
  marble_call* call = NULL;
  marble_error error;
  const char* state = NULL;
  char id[MARBLE_JOB_ID_SIZE], again[MARBLE_JOB_ID_SIZE];
  CHECK(marble_call_create(&call, NULL) == MARBLE_OK);
  CHECK(marble_call_set_priority(call, "now", &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(strcmp(error.field, "priority") == 0 && strcmp(error.value, "now") == 0 && error.bound[0] != '\0');
  CHECK(marble_call_set_priority(call, "batch", NULL) == MARBLE_OK);
  CHECK(marble_call_set_request_id(call, "c_test", NULL) == MARBLE_OK);
  CHECK(marble_job_submit(client, NULL, NULL, call, id, &error) == MARBLE_INVALID_ARGUMENT);
  CHECK(strcmp(error.field, "problem") == 0 && id[0] == '\0');
  CHECK(marble_job_submit(client, problem, NULL, call, id, &error) == (server ? MARBLE_OK : MARBLE_UNAVAILABLE));
  if (server) {
    CHECK(marble_job_submit(client, problem, NULL, call, again, &error) == MARBLE_OK && strcmp(id, again) == 0);
    CHECK(marble_job_result(client, id, 1, NULL, &solution, &error) == MARBLE_OK);
    check_answer(solution, -4);
    CHECK(marble_job_state(client, id, &state, &error) == MARBLE_OK && strcmp(state, "finished") == 0);
    CHECK(marble_job_cancel(client, id, &error) == MARBLE_OK); /* it has finished: nothing to end */
    CHECK(marble_job_remove(client, id, &error) == MARBLE_OK);
    CHECK(marble_job_result(client, id, 0, call, &solution, &error) == MARBLE_NOT_FOUND && solution == NULL);
  }
  marble_solution_destroy(solution);
  marble_call_destroy(call);
  marble_problem_destroy(problem);
}

static void* solve_many(void* client) {
  for (int i = 0; i < 20; i++) {
    marble_problem* problem = first();
    marble_solution* solution = NULL;
    CHECK(marble_solve(client, problem, NULL, NULL, &solution, NULL) == MARBLE_OK);
    check_answer(solution, -4);
    marble_solution_destroy(solution);
    marble_problem_destroy(problem);
  }
  return NULL;
}

static void two_threads_share_a_client(marble_client* client) {
  pthread_t threads[2];
  for (int i = 0; i < 2; i++) CHECK(pthread_create(&threads[i], NULL, solve_many, client) == 0);
  for (int i = 0; i < 2; i++) CHECK(pthread_join(threads[i], NULL) == 0);
}

/* Asked for by a thread of its own, from within the solve, so that the solve is known to go on. */
static void* cancel(void* call) {
  marble_call_cancel(call);
  return NULL;
}

static int cancel_by_a_thread(const marble_progress* progress, void* call) {
  pthread_t thread;
  (void)progress;
  CHECK(pthread_create(&thread, NULL, cancel, call) == 0);
  CHECK(pthread_join(thread, NULL) == 0);
  return 0;
}

static void another_thread_ends_a_solve(const marble_client* client) {
  marble_problem* problem = first();
  marble_solution* solution = NULL;
  marble_call* call = NULL;
  CHECK(marble_call_create(&call, NULL) == MARBLE_OK);
  CHECK(marble_call_set_progress(call, cancel_by_a_thread, call, NULL) == MARBLE_OK);
  CHECK(marble_solve(client, problem, NULL, call, &solution, NULL) == MARBLE_CANCELLED && solution == NULL);
  marble_call_destroy(call);
  marble_problem_destroy(problem);
}

/* Of a file: z and the objective in hexadecimal, for a comparison to the last bit. */
static int print_answer(const marble_client* client, const char* path) {
  marble_problem* problem = NULL;
  marble_solution* solution = NULL;
  marble_error error;
  const double* z = NULL;
  int64_t count = 0;
  if (marble_problem_read(path, &problem, &error) != MARBLE_OK ||
      marble_solve(client, problem, NULL, NULL, &solution, &error) != MARBLE_OK) {
    fprintf(stderr, "%s\n", error.message);
    return 1;
  }
  marble_solution_vector(solution, "z", &z, &count, NULL);
  printf("%a\n", marble_solution_objective(solution));
  for (int64_t i = 0; i < count; i++) printf("%a\n", z[i]);
  marble_solution_destroy(solution);
  marble_problem_destroy(problem);
  return 0;
}

/* Says when the server is to be stopped and when it is to go on, and waits for a line each time. */
static int hung(const marble_client* client) {
  marble_problem* problem = first();
  marble_call* call = NULL;
  marble_session* session = NULL;
  marble_solution* solution = NULL;
  marble_error error;
  char line[8];
  CHECK(marble_call_create(&call, NULL) == MARBLE_OK);
  CHECK(marble_session_open(client, problem, NULL, call, &session, &error) == MARBLE_OK);
  CHECK(marble_session_solve(session, &solution, &error) == MARBLE_OK);
  marble_solution_destroy(solution);
  puts("stop"), fflush(stdout);
  CHECK(fgets(line, sizeof line, stdin) != NULL);
  CHECK(marble_call_set_deadline(call, 0.02, &error) == MARBLE_OK);
  CHECK(marble_session_solve(session, &solution, &error) == MARBLE_DEADLINE_EXCEEDED && solution == NULL);
  CHECK(strstr(error.message, "the server did not answer within 0.12 s") != NULL);
  puts("go on"), fflush(stdout);
  CHECK(fgets(line, sizeof line, stdin) != NULL);
  CHECK(marble_call_set_deadline(call, 60, &error) == MARBLE_OK);
  CHECK(marble_session_solve(session, &solution, &error) == MARBLE_OK);
  check_answer(solution, -4);
  marble_solution_destroy(solution);
  marble_session_destroy(session);
  marble_call_destroy(call);
  marble_problem_destroy(problem);
  return failures != 0;
}

/* Usage: c_test [FILE | --hung]    on the server that MARBLE_SERVER names, or in process */
int main(int argc, char** argv) {
  marble_client* client = NULL;
  marble_error error;
  int status = 0;
  if (marble_client_connect_for_control(NULL, &client, &error) != MARBLE_OK) {
    fprintf(stderr, "%s\n", error.message);
    return 1;
  }
  if (argc > 1 && strcmp(argv[1], "--hung") == 0) {
    status = hung(client);
  } else if (argc > 1) {
    status = print_answer(client, argv[1]);
  } else {
    CHECK(marble_abi_version() == MARBLE_ABI_VERSION && marble_version()[0] != '\0');
    an_answer_and_its_numbers_without_copies(client);
    a_fault_names_field_index_value_and_bound(client);
    null_is_a_fault_and_never_a_crash();
    an_answer_is_started_from(client);
    an_infeasible_problem_is_explained(client);
    derivatives_come_with_answers(client);
    a_job_is_submitted_and_its_answer_fetched(client);
    a_session_takes_what_changed_and_starts_warm(client);
    a_session_that_may_be_reopened_says_whether_it_was(client);
    two_threads_share_a_client(client);
    another_thread_ends_a_solve(client);
    printf("%s: %d failures\n", marble_client_address(client), failures);
    status = failures != 0;
  }
  marble_client_destroy(client);
  return status;
}
