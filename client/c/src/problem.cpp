#include "handles.h"
#include "marble/problem_file.h"

using marble::Expected;
using marble::invalid;
using marble::unexpected;
using marble::c::change;
using marble::c::guarded;
using marble::c::in_use;
using marble::c::null;

namespace marble::c {

Expected<void> set_matrix(SparseMatrix& matrix, const std::string& part, std::int32_t rows,
                          std::int32_t columns, const std::int32_t* column_pointers, std::int64_t entries,
                          const std::int32_t* row_indices, const double* values) {
  MARBLE_RETURN_IF_ERROR(check_count(part + ".rows", rows));
  MARBLE_RETURN_IF_ERROR(check_count(part + ".columns", columns));
  MARBLE_RETURN_IF_ERROR(check_count(part + ".entries", entries));
  if (column_pointers == nullptr) return unexpected(null("column_pointers"));
  if (entries > 0 && row_indices == nullptr) return unexpected(null("row_indices"));
  if (entries > 0 && values == nullptr) return unexpected(null("values"));
  matrix = SparseMatrix{rows,
                        columns,
                        {column_pointers, column_pointers + columns + 1},
                        {row_indices, row_indices + entries},
                        {values, values + entries}};
  return {};
}

}  // namespace marble::c

std::int32_t marble_problem_create(std::int32_t variables, marble_problem** problem, marble_error* error) {
  if (problem != nullptr) *problem = nullptr;
  return guarded(error, [&]() -> Expected<void> {
    if (problem == nullptr) return unexpected(null("problem"));
    if (variables < 0) return unexpected(invalid("variables", std::to_string(variables), "must be >= 0"));
    auto made = std::make_unique<marble_problem>();
    made->problem.g.assign(static_cast<std::size_t>(variables), 0.0);
    *problem = made.release();
    return {};
  });
}

std::int32_t marble_problem_read(const char* path, marble_problem** problem, marble_error* error) {
  if (problem != nullptr) *problem = nullptr;
  return guarded(error, [&]() -> Expected<void> {
    if (path == nullptr) return unexpected(null("path"));
    if (problem == nullptr) return unexpected(null("problem"));
    MARBLE_ASSIGN_OR_RETURN(auto file, marble::read_problem(path));
    *problem = new marble_problem{.problem = std::move(file.problem)};
    return {};
  });
}

void marble_problem_destroy(marble_problem* problem) { delete problem; }

std::int32_t marble_problem_variables(const marble_problem* problem) {
  return problem == nullptr ? 0 : static_cast<std::int32_t>(problem->problem.g.size());
}

std::int32_t marble_problem_pairs(const marble_problem* problem) {
  return problem == nullptr ? 0 : static_cast<std::int32_t>(problem->problem.l.size());
}

std::int32_t marble_problem_set_vector(marble_problem* problem, const char* part, const double* values,
                                       std::int64_t count, marble_error* error) {
  return change(problem, "problem", error, [&]() -> Expected<void> {
    if (part == nullptr) return unexpected(null("part"));
    MARBLE_ASSIGN_OR_RETURN(const auto given, marble::c::numbers(values, count));
    const std::string name = part;
    if (name == "c0") {
      if (count != 1) return unexpected(invalid("c0", std::to_string(count), "must be 1 number"));
      problem->problem.c0 = *values;
      return {};
    }
#define MARBLE_VECTOR(letter, field)                            \
  if (name == #letter) {                                        \
    problem->problem.letter.assign(given.begin(), given.end()); \
    return {};                                                  \
  }
#include "marble/contract.def"
    return unexpected(invalid("part", name, "must be c0, g, b, d, l or r"));
  });
}

std::int32_t marble_problem_set_matrix(marble_problem* problem, const char* part, std::int32_t rows,
                                       std::int32_t columns, const std::int32_t* column_pointers,
                                       std::int64_t entries, const std::int32_t* row_indices,
                                       const double* values, marble_error* error) {
  return change(problem, "problem", error, [&]() -> Expected<void> {
    if (part == nullptr) return unexpected(null("part"));
    const std::string name = part;
#define MARBLE_MATRIX(letter, field, update, vector)                                                     \
  if (name == #letter) {                                                                                 \
    return marble::c::set_matrix(problem->problem.letter, name, rows, columns, column_pointers, entries, \
                                 row_indices, values);                                                   \
  }
#include "marble/contract.def"
    return unexpected(invalid("part", name, "must be Q, A, C, L or R"));
  });
}

std::int32_t marble_problem_check(const marble_problem* problem, marble_error* error) {
  return guarded(error, [&]() -> Expected<void> {
    if (problem == nullptr) return unexpected(null("problem"));
    const std::shared_lock reading(problem->usage, std::try_to_lock);
    if (!reading) return unexpected(in_use("problem"));
    MARBLE_RETURN_IF_ERROR(marble::Problem::create(problem->problem.view()));
    return {};
  });
}
