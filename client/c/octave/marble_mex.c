/* Implements marble_solve.m and marble_session.m; see them. marble_mex(command, ...) with a problem as a
 * struct of sparse matrices and columns. */
#include <marble.h>
#include <mex.h>
#include <stdio.h>
#include <string.h>

#define MOST_SESSIONS 64

/* A handle is a number that is never reused: a closed handle stays closed. */
static marble_session* sessions[MOST_SESSIONS];
static double handles[MOST_SESSIONS];
static double last_handle = 0;

static void close_all(void) {
  for (int i = 0; i < MOST_SESSIONS; i++) marble_session_destroy(sessions[i]);
  memset(sessions, 0, sizeof sessions);
}

/* Owned by this call; freed before an error leaves it. */
typedef struct held {
  marble_problem* problem;
  marble_options* options;
  marble_call* call;
  marble_solution* solution;
} held;

static void drop(held* all) {
  marble_solution_destroy(all->solution);
  marble_call_destroy(all->call);
  marble_options_destroy(all->options);
  marble_problem_destroy(all->problem);
  memset(all, 0, sizeof *all);
}

static void check(int32_t code, const marble_error* error, held* all) {
  char name[128];
  if (code == MARBLE_OK) return;
  drop(all);
  snprintf(name, sizeof name, "marble:%s", marble_error_name(code));
  mexErrMsgIdAndTxt(name, "%s", error->message);
}

static void refuse(const char* what, held* all) {
  drop(all);
  mexErrMsgIdAndTxt("marble:invalid_argument", "%s", what);
}

static const mxArray* doubles(const mxArray* array, const char* name, held* all) {
  char text[128];
  if (array != NULL && mxIsDouble(array) && !mxIsComplex(array)) return array;
  snprintf(text, sizeof text, "%.40s: must be real doubles", name);
  refuse(text, all);
  return NULL;
}

static const mxArray* vector(const mxArray* array, const char* name, held* all) {
  if (mxIsSparse(doubles(array, name, all))) refuse("vectors must be full", all);
  return array;
}

static void check_struct(const mxArray* array, const char* usage, held* all) {
  if (!mxIsStruct(array) || mxGetNumberOfElements(array) != 1) refuse(usage, all);
}

static void take_matrix(held* all, const char* name, const mxArray* array) {
  marble_error error;
  const size_t columns = mxGetN(array);
  const mwIndex* pointers = NULL;
  const mwIndex* indices = NULL;
  int32_t *p, *i;
  size_t entries, k;
  if (!mxIsSparse(doubles(array, name, all))) refuse("matrices must be sparse", all);
  if (mxGetM(array) > INT32_MAX || columns >= INT32_MAX) refuse("a matrix is too large", all);
  pointers = mxGetJc(array);
  indices = mxGetIr(array);
  entries = (size_t)pointers[columns];
  if (entries > INT32_MAX) refuse("a matrix has too many entries", all);
  p = mxMalloc((columns + 1) * sizeof *p);
  i = mxMalloc((entries + 1) * sizeof *i);
  for (k = 0; k <= columns; k++) p[k] = (int32_t)pointers[k];
  for (k = 0; k < entries; k++) i[k] = (int32_t)indices[k];
  check(marble_problem_set_matrix(all->problem, name, (int32_t)mxGetM(array), (int32_t)columns, p,
                                  (int64_t)entries, i, mxGetPr(array), &error),
        &error, all);
  mxFree(p);
  mxFree(i);
}

static int is_matrix(const char* name) { return strlen(name) == 1 && strchr("QACLR", name[0]) != NULL; }

/* Copies a struct's parts to the problem, and z0 to the call. */
static void take_problem(held* all, const mxArray* parts) {
  marble_error error;
  check(marble_problem_create(0, &all->problem, &error), &error, all);
  check(marble_call_create(&all->call, &error), &error, all);
  for (int k = 0; k < mxGetNumberOfFields(parts); k++) {
    const char* name = mxGetFieldNameByNumber(parts, k);
    const mxArray* array = mxGetFieldByNumber(parts, 0, k);
    int64_t count;
    if (is_matrix(name)) {
      take_matrix(all, name, array);
      continue;
    }
    count = (int64_t)mxGetNumberOfElements(vector(array, name, all));
    if (strcmp(name, "z0") == 0) {
      check(marble_call_set_initial_z(all->call, mxGetPr(array), count, &error), &error, all);
    } else {
      check(marble_problem_set_vector(all->problem, name, mxGetPr(array), count, &error), &error, all);
    }
  }
}

static void take_options(held* all, const mxArray* options) {
  marble_error error;
  check(marble_options_create(&all->options, &error), &error, all);
  for (int k = 0; k < mxGetNumberOfFields(options); k++) {
    const char* name = mxGetFieldNameByNumber(options, k);
    const mxArray* value = mxGetFieldByNumber(options, 0, k);
    if (value == NULL) refuse("an option must be a number or a text", all);
    if (mxIsChar(value)) {
      char* text = mxArrayToString(value);
      const int32_t code = marble_options_set(all->options, name, text, &error);
      mxFree(text);
      check(code, &error, all);
    } else if (mxGetNumberOfElements(value) == 1 && !mxIsSparse(value) && !mxIsComplex(value) &&
               (mxIsNumeric(value) || mxIsLogical(value))) {
      check(marble_options_set_number(all->options, name, mxGetScalar(value), &error), &error, all);
    } else {
      refuse("an option must be a number or a text", all);
    }
  }
}

/* A struct, or [] where there is none. Indices count from 1, as Octave's do. */
static mxArray* conflict_of(const marble_solution* solution) {
  static const char* const parts[] = {"equalities", "inequalities", "left_sides", "right_sides",
                                      "complementarities"};
  double kind = 0;
  mxArray* conflict;
  marble_solution_number(solution, "conflict", &kind, NULL);
  if (kind == 0) return mxCreateDoubleMatrix(0, 0, mxREAL);
  conflict = mxCreateStructMatrix(1, 1, 0, NULL);
  for (size_t k = 0; k < sizeof parts / sizeof *parts; k++) {
    const int32_t* indices = NULL;
    int64_t count = 0;
    mxArray* column;
    marble_solution_conflict(solution, parts[k], &indices, &count, NULL);
    column = mxCreateDoubleMatrix((mwSize)count, 1, mxREAL);
    for (int64_t i = 0; i < count; i++) mxGetPr(column)[i] = indices[i] + 1.0;
    mxAddField(conflict, parts[k]);
    mxSetField(conflict, 0, parts[k], column);
  }
  mxAddField(conflict, "minimal");
  mxSetField(conflict, 0, "minimal", mxCreateLogicalScalar(kind == 2));
  mxAddField(conflict, "detail");
  mxSetField(conflict, 0, "detail", mxCreateString(marble_solution_conflict_detail(solution)));
  return conflict;
}

static mxArray* answer_of(held* all) {
  static const char* const vectors[] = {"z", "y", "nu", "xi", "eta", "certificate"};
  static const char* const numbers[] = {
      "objective", "bound", "gap", "proved", "iterations", "factorizations", "complementarity_violation",
      "total_s"};
  mxArray* answer = mxCreateStructMatrix(1, 1, 0, NULL);
  for (size_t k = 0; k < sizeof vectors / sizeof *vectors; k++) {
    const double* values = NULL;
    int64_t count = 0;
    mxArray* column;
    marble_solution_vector(all->solution, vectors[k], &values, &count, NULL);
    column = mxCreateDoubleMatrix((mwSize)count, 1, mxREAL);
    if (count > 0) memcpy(mxGetPr(column), values, (size_t)count * sizeof *values);
    mxAddField(answer, vectors[k]);
    mxSetField(answer, 0, vectors[k], column);
  }
  for (size_t k = 0; k < sizeof numbers / sizeof *numbers; k++) {
    double value = 0;
    marble_solution_number(all->solution, numbers[k], &value, NULL);
    mxAddField(answer, numbers[k]);
    mxSetField(answer, 0, numbers[k], mxCreateDoubleScalar(value));
  }
  mxAddField(answer, "status");
  mxSetField(answer, 0, "status", mxCreateString(marble_status_name(marble_solution_status(all->solution))));
  mxAddField(answer, "detail");
  mxSetField(answer, 0, "detail", mxCreateString(marble_solution_detail(all->solution)));
  mxAddField(answer, "conflict");
  mxSetField(answer, 0, "conflict", conflict_of(all->solution));
  drop(all);
  return answer;
}

static marble_session** session_of(const mxArray* handle, held* all) {
  const int is_number = mxIsDouble(handle) && !mxIsSparse(handle) && mxGetNumberOfElements(handle) == 1;
  for (int k = 0; is_number && k < MOST_SESSIONS; k++) {
    if (sessions[k] != NULL && handles[k] == mxGetScalar(handle)) return &sessions[k];
  }
  refuse("the session is not open", all);
  return NULL;
}

void mexFunction(int results, mxArray** result, int count, const mxArray** given) {
  held all = {NULL, NULL, NULL, NULL};
  marble_error error;
  char command[16];
  (void)results;
  if (count < 2 || mxGetString(given[0], command, sizeof command) != 0) refuse("see marble_solve", &all);
  mexAtExit(close_all);
  if (strcmp(command, "solve") == 0 || strcmp(command, "open") == 0) {
    if (count != 3) refuse("see marble_solve", &all);
    check_struct(given[1], "the problem must be one struct", &all);
    check_struct(given[2], "options must be one struct", &all);
    take_problem(&all, given[1]);
    take_options(&all, given[2]);
    if (command[0] == 's') {
      check(marble_solve(NULL, all.problem, all.options, all.call, &all.solution, &error), &error, &all);
      result[0] = answer_of(&all);
    } else {
      int place = 0;
      while (place < MOST_SESSIONS && sessions[place] != NULL) place++;
      if (place == MOST_SESSIONS) refuse("64 sessions are open", &all);
      /* Without the call, which ends here: z0 is sent with the first solve. */
      check(marble_session_open(NULL, all.problem, all.options, NULL, &sessions[place], &error), &error,
            &all);
      if (mxGetField(given[1], 0, "z0") != NULL) {
        const mxArray* z0 = mxGetField(given[1], 0, "z0");
        const int64_t numbers = (int64_t)mxGetNumberOfElements(z0);
        const int32_t code = marble_session_set_initial_z(sessions[place], mxGetPr(z0), numbers, &error);
        if (code != MARBLE_OK) {
          marble_session_destroy(sessions[place]);
          sessions[place] = NULL;
        }
        check(code, &error, &all);
      }
      drop(&all);
      handles[place] = ++last_handle;
      result[0] = mxCreateDoubleScalar(last_handle);
    }
  } else if (strcmp(command, "update") == 0) {
    marble_session* session;
    if (count != 3) refuse("see marble_session", &all);
    check_struct(given[2], "changes must be one struct", &all);
    session = *session_of(given[1], &all);
    for (int k = 0; k < mxGetNumberOfFields(given[2]); k++) {
      const char* name = mxGetFieldNameByNumber(given[2], k);
      const mxArray* array = vector(mxGetFieldByNumber(given[2], 0, k), name, &all);
      const int64_t numbers = (int64_t)mxGetNumberOfElements(array);
      check(strcmp(name, "z0") == 0 ? marble_session_set_initial_z(session, mxGetPr(array), numbers, &error)
                                    : marble_session_set(session, name, mxGetPr(array), numbers, &error),
            &error, &all);
    }
    check(marble_session_solve(session, &all.solution, &error), &error, &all);
    result[0] = answer_of(&all);
  } else if (strcmp(command, "close") == 0) {
    marble_session** session = session_of(given[1], &all);
    marble_session_destroy(*session);
    *session = NULL;
  } else {
    refuse("see marble_solve", &all);
  }
}
