#include <algorithm>

#include "handles.h"

using marble::Expected;
using marble::invalid;
using marble::unexpected;
using marble::c::change;
using marble::c::guarded;
using marble::c::none_lent;
using marble::c::null;

namespace {

using Derivatives = marble::OwnedSensitivityRequest;
using Numbers = std::vector<double>;

// Returns a part by its name in this interface.
Numbers* part_of(Derivatives& asked, std::string_view name) {
#define MARBLE_VECTOR(letter, field) \
  if (name == #letter) return &asked.numbers.letter;
#define MARBLE_MATRIX(letter, field, update, vector) \
  if (name == #letter) return &asked.numbers.letter.values;
#include "marble/contract.def"
  return nullptr;
}
template <class Vectors>
auto vector_of(Vectors& all, std::string_view name) -> decltype(&all.z) {
  if (name == "z") return &all.z;
  if (name == "y") return &all.equality_multipliers;
  if (name == "nu") return &all.inequality_multipliers;
  if (name == "xi") return &all.complementarity_multipliers_L;
  return name == "eta" ? &all.complementarity_multipliers_R : nullptr;
}
const Numbers* part_of(const marble::ProblemGradients& gradients, std::string_view name) {
#define MARBLE_VECTOR(letter, field) \
  if (name == #letter) return &gradients.letter;
#define MARBLE_MATRIX(letter, field, update, vector) \
  if (name == #letter) return &gradients.letter;
#include "marble/contract.def"
  return nullptr;
}
const Numbers* part_of(const marble::RowResponse& rows, std::string_view name) {
  if (name == "values") return &rows.values;
  if (name == "free") return &rows.free;
  if (name == "response") return &rows.response;
  if (name == "z") return &rows.z;
  return name == "columns" ? &rows.columns : nullptr;
}

constexpr const char* kParts = "must be g, b, d, l, r, Q, A, C, L or R";
constexpr const char* kVectors = "must be z, y, nu, xi or eta";

marble::Error none(const char* field, const char* why) {
  return marble::failure(marble::ErrorCode::failed_precondition, field, why);
}

Expected<const marble::SensitivityAnswer*> reported(const marble_solution* solution) {
  if (solution == nullptr) return unexpected(null("solution"));
  const auto& sensitivity = solution->solution.sensitivity;
  if (!sensitivity) return unexpected(none("solution", "has no derivatives: none were asked for"));
  if (!*sensitivity) return unexpected(sensitivity->error());
  return &**sensitivity;
}

// Lends item `at` of `count` items from the array that `find` returns for the name.
template <class All, class Find>
Expected<void> lend(const All& all, std::int32_t at, std::size_t count, const char* what, const char* name,
                    const char* parameter, const char* names, const Find& find, const double** values,
                    std::int64_t* size) {
  if (name == nullptr) return unexpected(null(parameter));
  if (values == nullptr) return unexpected(null("values"));
  if (size == nullptr) return unexpected(null("count"));
  const Numbers* const numbers = find(all, name);
  if (numbers == nullptr) return unexpected(invalid(parameter, name, names));
  if (at < 0 || static_cast<std::size_t>(at) >= count) {
    return unexpected(invalid(what, std::to_string(at), "must be in [0, " + std::to_string(count) + ")"));
  }
  const std::size_t each = numbers->size() / count;
  *values = numbers->data() + static_cast<std::size_t>(at) * each;
  *size = static_cast<std::int64_t>(each);
  return {};
}

// Sets the array that `find` returns for the name, for the given number of directions or losses.
template <class Forget, class Find>
std::int32_t set_list(marble_call* call, std::int32_t number, const char* what, const char* name,
                      const char* parameter, const char* names, const double* values, std::int64_t count,
                      marble_error* error, std::int32_t Derivatives::*number_of, const Forget& forget,
                      const Find& find) {
  return change(call, "call", error, [&]() -> Expected<void> {
    if (number < 0) return unexpected(invalid(what, std::to_string(number), "must be >= 0"));
    Derivatives& asked = call->derivatives;
    if (number > 0) {
      if (name == nullptr) return unexpected(null(parameter));
      if (find(asked, name) == nullptr) return unexpected(invalid(parameter, name, names));
      MARBLE_ASSIGN_OR_RETURN(const auto given, marble::c::numbers(values, count));
      Numbers copy(given.begin(), given.end());
      if (asked.*number_of != number) forget(asked);
      *find(asked, name) = std::move(copy);
    } else {
      forget(asked);
    }
    asked.*number_of = number;
    return {};
  });
}

}  // namespace

std::int32_t marble_call_set_directions(marble_call* call, std::int32_t directions, const char* part,
                                        const double* values, std::int64_t count, marble_error* error) {
  return set_list(
      call, directions, "directions", part, "part", kParts, values, count, error, &Derivatives::directions,
      [](Derivatives& asked) { asked.numbers = {}; },
      [](Derivatives& asked, std::string_view name) { return part_of(asked, name); });
}

std::int32_t marble_call_set_losses(marble_call* call, std::int32_t losses, const char* vector,
                                    const double* values, std::int64_t count, marble_error* error) {
  return set_list(
      call, losses, "losses", vector, "vector", kVectors, values, count, error, &Derivatives::losses,
      [](Derivatives& asked) {
        for (const char* name : {"z", "y", "nu", "xi", "eta"}) vector_of(asked, name)->clear();
      },
      [](Derivatives& asked, std::string_view name) { return vector_of(asked, name); });
}

std::int32_t marble_call_set_rows(marble_call* call, std::int32_t rows, std::int32_t columns,
                                  const std::int32_t* column_pointers, std::int64_t entries,
                                  const std::int32_t* row_indices, const double* values,
                                  std::int32_t report_columns, marble_error* error) {
  return change(call, "call", error, [&]() -> Expected<void> {
    Derivatives& asked = call->derivatives;
    if (rows != 0) {
      MARBLE_RETURN_IF_ERROR(marble::c::set_matrix(asked.E, "rows", rows, columns, column_pointers, entries,
                                                   row_indices, values));
    } else {
      asked.E = {};
      asked.proximal.clear(), asked.g.clear();
    }
    asked.columns = report_columns != 0;
    return {};
  });
}

std::int32_t marble_call_set_rows_vector(marble_call* call, const char* name, const double* values,
                                         std::int64_t count, marble_error* error) {
  return change(call, "call", error, [&]() -> Expected<void> {
    if (name == nullptr) return unexpected(null("name"));
    const std::string_view which = name;
    if (which != "proximal" && which != "g")
      return unexpected(invalid("name", name, "must be proximal or g"));
    MARBLE_ASSIGN_OR_RETURN(const auto given, marble::c::numbers(values, count));
    (which == "g" ? call->derivatives.g : call->derivatives.proximal).assign(given.begin(), given.end());
    return {};
  });
}

std::int32_t marble_solution_change(const marble_solution* solution, std::int32_t direction, const char* name,
                                    const double** values, std::int64_t* count, marble_error* error) {
  none_lent(values, count);
  return guarded(error, [&]() -> Expected<void> {
    MARBLE_ASSIGN_OR_RETURN(const auto sensitivity, reported(solution));
    const marble::AnswerChanges& changes = sensitivity->changes;
    if (std::ranges::count(changes.undefined, direction) > 0)
      return unexpected(
          none("direction", "has no change: the branch is flat along it, or its rows contradict"));
    return lend(
        changes, direction, changes.active_set_constant.size(), "direction", name, "name", kVectors,
        [](const auto& all, std::string_view which) { return vector_of(all, which); }, values, count);
  });
}

std::int32_t marble_solution_active_set_constant(const marble_solution* solution, std::int32_t direction) {
  const auto sensitivity = reported(solution);
  if (!sensitivity || direction < 0) return -1;
  const marble::AnswerChanges& changes = (*sensitivity)->changes;
  const auto at = static_cast<std::size_t>(direction);
  if (at >= changes.active_set_constant.size() || std::ranges::count(changes.undefined, direction) > 0)
    return -1;
  return changes.active_set_constant[at];
}

std::int32_t marble_solution_gradient(const marble_solution* solution, std::int32_t loss, const char* part,
                                      const double** values, std::int64_t* count, marble_error* error) {
  none_lent(values, count);
  return guarded(error, [&]() -> Expected<void> {
    MARBLE_ASSIGN_OR_RETURN(const auto sensitivity, reported(solution));
    const marble::ProblemGradients& gradients = sensitivity->gradients;
    if (std::ranges::count(gradients.undefined, loss) > 0) {
      return unexpected(
          none("loss", "has no gradient: multipliers that it weighs are not unique, or the branch is flat"));
    }
    const std::size_t losses = gradients.g.size() / std::max<std::size_t>(1, solution->solution.z.size());
    return lend(
        gradients, loss, losses, "loss", part, "part", kParts,
        [](const auto& all, std::string_view which) { return part_of(all, which); }, values, count);
  });
}

std::int32_t marble_solution_response(const marble_solution* solution, const char* name,
                                      const double** values, std::int64_t* count, marble_error* error) {
  none_lent(values, count);
  return guarded(error, [&]() -> Expected<void> {
    MARBLE_ASSIGN_OR_RETURN(const auto sensitivity, reported(solution));
    const auto& rows = sensitivity->rows;
    if (!rows) return unexpected(none("rows", "have no response: none was asked for"));
    if (!*rows) return unexpected(rows->error());
    return lend(
        **rows, 0, 1, "rows", name, "name", "must be values, free, response, z or columns",
        [](const auto& all, std::string_view which) { return part_of(all, which); }, values, count);
  });
}

std::int32_t marble_solution_weak(const marble_solution* solution, const char* name,
                                  const std::int32_t** indices, std::int64_t* count, marble_error* error) {
  none_lent(indices, count);
  return guarded(error, [&]() -> Expected<void> {
    MARBLE_ASSIGN_OR_RETURN(const auto sensitivity, reported(solution));
    if (name == nullptr) return unexpected(null("name"));
    if (indices == nullptr) return unexpected(null("indices"));
    if (count == nullptr) return unexpected(null("count"));
    const std::string_view which = name;
    if (which != "inequalities" && which != "pairs")
      return unexpected(invalid("name", name, "must be inequalities or pairs"));
    const auto& weak = which == "pairs" ? sensitivity->biactive_pairs : sensitivity->weak_inequalities;
    *indices = weak.data();
    *count = static_cast<std::int64_t>(weak.size());
    return {};
  });
}
