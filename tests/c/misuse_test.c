/* Misuse of the C interface: one wrong argument at a time, of every function of marble.h (misuse_test.py
 * writes misuse_cases.h from the header), handles that a progress function changes, and handles that threads
 * share. */
#include <marble.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "check.h"

static int cases = 0;

/* Valid handles and places for every kind of argument. A case gets new ones. */
typedef struct fixture {
  marble_client* client;
  marble_problem* problem;
  marble_options* options;
  marble_call* call;
  marble_session* session;
  marble_solution* solution;
  marble_error error;
  char job_id[MARBLE_JOB_ID_SIZE];
  /* What a function makes. */
  marble_client* new_client;
  marble_problem* new_problem;
  marble_options* new_options;
  marble_call* new_call;
  marble_session* new_session;
  marble_solution* new_solution;
  const char* state;
  double number;
  const double* values;
  const int32_t* indices;
  int64_t count;
} fixture;

static const int32_t two_columns[] = {0, 1, 2}, two_rows[] = {0, 1}, left[] = {0, 1, 1}, right[] = {0, 0, 1};
static const double twos[] = {2, 2}, zeros[] = {0, 0}, g[] = {-2, -4};
static char long_text[1 << 20];

/* min z0^2 - 2 z0 + z1^2 - 4 z1, 0 <= z0 _|_ z1 >= 0. */
static marble_problem* pair(void) {
  marble_problem* problem = NULL;
  CHECK(marble_problem_create(2, &problem, NULL) == MARBLE_OK);
  CHECK(marble_problem_set_vector(problem, "g", g, 2, NULL) == MARBLE_OK);
  CHECK(marble_problem_set_matrix(problem, "Q", 2, 2, two_columns, 2, two_rows, twos, NULL) == MARBLE_OK);
  CHECK(marble_problem_set_matrix(problem, "L", 1, 2, left, 1, two_rows, twos, NULL) == MARBLE_OK);
  CHECK(marble_problem_set_matrix(problem, "R", 1, 2, right, 1, two_rows, twos, NULL) == MARBLE_OK);
  CHECK(marble_problem_set_vector(problem, "l", zeros, 1, NULL) == MARBLE_OK);
  CHECK(marble_problem_set_vector(problem, "r", zeros, 1, NULL) == MARBLE_OK);
  return problem;
}

static int go_on(const marble_progress* progress, void* user) {
  (void)progress;
  (void)user;
  return 0;
}

static void begin(fixture* f, marble_client* client) {
  memset(f, 0, sizeof *f);
  f->client = client;
  f->problem = pair();
  CHECK(marble_options_create(&f->options, NULL) == MARBLE_OK);
  CHECK(marble_call_create(&f->call, NULL) == MARBLE_OK);
  CHECK(marble_call_set_directions(f->call, 1, "g", g, 2, NULL) == MARBLE_OK);
  CHECK(marble_call_set_losses(f->call, 1, "z", g, 2, NULL) == MARBLE_OK);
  CHECK(marble_call_set_rows(f->call, 2, 2, two_columns, 2, two_rows, twos, 1, NULL) == MARBLE_OK);
  CHECK(marble_solve(client, f->problem, f->options, f->call, &f->solution, NULL) == MARBLE_OK);
  CHECK(marble_session_open(client, f->problem, f->options, f->call, &f->session, NULL) == MARBLE_OK);
  strcpy(f->job_id, "no-job");
}

static void end(fixture* f) {
  marble_solution* solution = NULL;
  /* Whatever was refused, the session still solves what it had, and a fault changed nothing else. */
  const int32_t code =
      f->session == NULL ? MARBLE_OK : marble_session_solve(f->session, &solution, &f->error);
  CHECK(code != MARBLE_INTERNAL && (solution != NULL) == (code == MARBLE_OK && f->session != NULL));
  marble_solution_destroy(solution);
  marble_session_destroy(f->session);
  marble_session_destroy(f->new_session);
  marble_solution_destroy(f->solution);
  marble_solution_destroy(f->new_solution);
  marble_call_destroy(f->call);
  marble_call_destroy(f->new_call);
  marble_options_destroy(f->options);
  marble_options_destroy(f->new_options);
  marble_problem_destroy(f->problem);
  marble_problem_destroy(f->new_problem);
  marble_client_destroy(f->new_client);
}

/* `code` is what the call returned. A NULL that is not allowed is MARBLE_INVALID_ARGUMENT of that parameter;
 * any other wrong argument is a known code, never MARBLE_INTERNAL. What is made is NULL where the call
 * failed. */
static void judge(const char* name, fixture* f, int32_t code, const char* null_parameter) {
  cases++;
  const int made = f->new_client || f->new_problem || f->new_options || f->new_call || f->new_session ||
                   f->new_solution || f->state || f->values || f->indices || f->count != 0;
  int good = strcmp(marble_error_name(code), "unknown") != 0 && code != MARBLE_INTERNAL &&
             !(code != MARBLE_OK && made);
  if (null_parameter != NULL) {
    good = good && code == MARBLE_INVALID_ARGUMENT;
    if (strcmp(null_parameter, "error") != 0)
      good = good && strcmp(f->error.field, null_parameter) == 0 &&
             strcmp(f->error.bound, "must not be NULL") == 0;
  }
  if (good) return;
  failures++;
  fprintf(stderr, "%s: %s %s[%d] %s, something is lent or made: %d\n", name, marble_error_name(code),
          f->error.field, (int)f->error.index, f->error.bound, made);
}

/* `set` fills what the call must empty when it fails. */
#define CASE(name, null_parameter, set, call) \
  do {                                        \
    fixture f;                                \
    begin(&f, client);                        \
    set;                                      \
    judge(name, &f, call, null_parameter);    \
    end(&f);                                  \
  } while (0)

#define PLAIN_CASE(name, call) \
  do {                         \
    fixture f;                 \
    begin(&f, client);         \
    cases++;                   \
    call;                      \
    end(&f);                   \
  } while (0)

static void every_function_bears_one_wrong_argument(marble_client* client) {
#include "misuse_cases.h"
}

/* What a progress function changes is in use, and stays as it is. */
typedef struct reentry {
  fixture* f;
  int reports;
} reentry;

static int change_everything(const marble_progress* progress, void* user) {
  reentry* const r = user;
  fixture* const f = r->f;
  const double many[64] = {0};
  marble_solution* inner = NULL;
  marble_error error;
  (void)progress;
  r->reports++;
  CHECK(marble_problem_set_vector(f->problem, "g", many, 64, &error) == MARBLE_FAILED_PRECONDITION);
  CHECK(strcmp(error.field, "problem") == 0);
  CHECK(marble_problem_set_matrix(f->problem, "Q", 0, 0, two_columns, 0, NULL, NULL, NULL) ==
        MARBLE_FAILED_PRECONDITION);
  CHECK(marble_call_set_initial_z(f->call, many, 64, &error) == MARBLE_FAILED_PRECONDITION);
  CHECK(strcmp(error.field, "call") == 0);
  CHECK(marble_call_set_warm_start(f->call, NULL, NULL) == MARBLE_FAILED_PRECONDITION);
  CHECK(marble_call_set_directions(f->call, 0, NULL, NULL, 0, NULL) == MARBLE_FAILED_PRECONDITION);
  CHECK(marble_call_set_losses(f->call, 0, NULL, NULL, 0, NULL) == MARBLE_FAILED_PRECONDITION);
  CHECK(marble_call_set_rows(f->call, 0, 0, NULL, 0, NULL, NULL, 0, NULL) == MARBLE_FAILED_PRECONDITION);
  CHECK(marble_call_set_rows_vector(f->call, "g", many, 64, NULL) == MARBLE_FAILED_PRECONDITION);
  CHECK(marble_call_set_progress(f->call, NULL, NULL, NULL) == MARBLE_FAILED_PRECONDITION);
  CHECK(marble_call_reset(f->call, NULL) == MARBLE_FAILED_PRECONDITION);
  /* Another problem on the same client is no misuse. */
  marble_problem* const other = pair();
  CHECK(marble_solve(f->client, other, NULL, NULL, &inner, NULL) == MARBLE_OK);
  marble_solution_destroy(inner);
  marble_problem_destroy(other);
  return 0;
}

static void a_progress_function_cannot_change_what_is_in_use(marble_client* client) {
  fixture f;
  memset(&f, 0, sizeof f);
  f.client = client;
  f.problem = pair();
  reentry r = {&f, 0};
  CHECK(marble_call_create(&f.call, NULL) == MARBLE_OK);
  CHECK(marble_call_set_initial_z(f.call, g, 2, NULL) == MARBLE_OK);
  CHECK(marble_call_set_progress(f.call, change_everything, &r, NULL) == MARBLE_OK);
  CHECK(marble_solve(client, f.problem, NULL, f.call, &f.solution, NULL) == MARBLE_OK && r.reports > 0);
  CHECK(fabs(marble_solution_objective(f.solution) + 4) < 1e-9);
  marble_solution_destroy(f.solution);
  marble_call_destroy(f.call);
  marble_problem_destroy(f.problem);
}

static int change_the_session(const marble_progress* progress, void* user) {
  reentry* const r = user;
  fixture* const f = r->f;
  marble_solution* inner = NULL;
  marble_error error;
  (void)progress;
  r->reports++;
  CHECK(marble_session_set(f->session, "g", zeros, 2, &error) == MARBLE_FAILED_PRECONDITION);
  CHECK(strcmp(error.field, "session") == 0);
  CHECK(marble_session_set_initial_z(f->session, zeros, 2, NULL) == MARBLE_FAILED_PRECONDITION);
  CHECK(marble_session_set_options(f->session, f->options, NULL) == MARBLE_FAILED_PRECONDITION);
  CHECK(marble_session_set_cold(f->session, NULL) == MARBLE_FAILED_PRECONDITION);
  CHECK(marble_session_shift(f->session, 1, NULL) == MARBLE_FAILED_PRECONDITION);
  CHECK(marble_session_solve(f->session, &inner, NULL) == MARBLE_FAILED_PRECONDITION && inner == NULL);
  CHECK(marble_call_set_directions(f->call, 0, NULL, NULL, 0, NULL) == MARBLE_FAILED_PRECONDITION);
  return 0;
}

static void a_progress_function_cannot_change_its_session(marble_client* client) {
  fixture f;
  memset(&f, 0, sizeof f);
  reentry r = {&f, 0};
  f.problem = pair();
  CHECK(marble_options_create(&f.options, NULL) == MARBLE_OK);
  CHECK(marble_call_create(&f.call, NULL) == MARBLE_OK);
  CHECK(marble_call_set_progress(f.call, change_the_session, &r, NULL) == MARBLE_OK);
  CHECK(marble_session_open(client, f.problem, NULL, f.call, &f.session, NULL) == MARBLE_OK);
  CHECK(marble_session_set(f.session, "g", g, 2, NULL) == MARBLE_OK);
  CHECK(marble_session_solve(f.session, &f.solution, NULL) == MARBLE_OK && r.reports > 0);
  CHECK(fabs(marble_solution_objective(f.solution) + 4) < 1e-9);
  end(&f);
}

/* Handles that threads share against the contract: a call fails or works, and memory stays whole. */
enum { ROUNDS = 40 };
typedef struct shared {
  marble_client* client;
  marble_problem* problem;
  marble_call* call;
  marble_session* session;
} shared;

static int is_allowed(int32_t code) {
  return code == MARBLE_OK || code == MARBLE_FAILED_PRECONDITION || code == MARBLE_CANCELLED;
}

static void* solve_shared(void* user) {
  shared* const s = user;
  for (int i = 0; i < ROUNDS; i++) {
    marble_solution* solution = NULL;
    CHECK(is_allowed(marble_solve(s->client, s->problem, NULL, s->call, &solution, NULL)));
    marble_solution_destroy(solution);
    CHECK(is_allowed(marble_session_solve(s->session, &solution, NULL)));
    marble_solution_destroy(solution);
  }
  return NULL;
}

static void* change_shared(void* user) {
  shared* const s = user;
  for (int i = 0; i < 10 * ROUNDS; i++) {
    CHECK(is_allowed(marble_problem_set_vector(s->problem, "g", g, 2, NULL)));
    CHECK(is_allowed(marble_call_set_initial_z(s->call, i % 2 == 0 ? g : NULL, i % 2 == 0 ? 2 : 0, NULL)));
    CHECK(is_allowed(marble_session_set(s->session, "g", g, 2, NULL)));
    marble_call_cancel(s->call);
    CHECK(is_allowed(marble_call_reset(s->call, NULL)));
  }
  return NULL;
}

static void threads_that_share_a_handle_cannot_break_it(marble_client* client) {
  shared s = {client, pair(), NULL, NULL};
  pthread_t threads[4];
  CHECK(marble_call_create(&s.call, NULL) == MARBLE_OK);
  CHECK(marble_session_open(client, s.problem, NULL, NULL, &s.session, NULL) == MARBLE_OK);
  for (int i = 0; i < 4; i++)
    CHECK(pthread_create(&threads[i], NULL, i % 2 == 0 ? solve_shared : change_shared, &s) == 0);
  for (int i = 0; i < 4; i++) CHECK(pthread_join(threads[i], NULL) == 0);
  marble_session_destroy(s.session);
  marble_call_destroy(s.call);
  marble_problem_destroy(s.problem);
}

int main(void) {
  marble_client* client = NULL;
  CHECK(go_on(NULL, NULL) == 0);
  memset(long_text, 'x', sizeof long_text - 1);
  CHECK(marble_client_connect(NULL, &client, NULL) == MARBLE_OK);
  every_function_bears_one_wrong_argument(client);
  a_progress_function_cannot_change_what_is_in_use(client);
  a_progress_function_cannot_change_its_session(client);
  threads_that_share_a_handle_cannot_break_it(client);
  printf("%s: %d cases, %d failures\n", marble_client_address(client), cases, failures);
  marble_client_destroy(client);
  return failures != 0;
}
