#include <algorithm>
#include <string>
#include <tuple>

#include "marble/sensitivity.h"
#include "model/check_matrix.h"
#include "model/tuning.h"

namespace marble {
namespace {

Expected<void> check_part(std::span<const double> values, std::size_t size, const char* field) {
  return values.empty() ? Expected<void>() : check_numbers(values, size, field);
}

Expected<void> check_rows(const RowsRequest& rows, std::size_t n) {
  if (rows.E.rows < 1) return unexpected(invalid("rows.E.rows", std::to_string(rows.E.rows), "must be >= 1"));
  MARBLE_RETURN_IF_ERROR(check_matrix(rows.E, "rows.E", static_cast<std::size_t>(rows.E.rows), n, ""));
  // Memory stays in proportion to the request: rows without entries cost nothing to send.
  const std::size_t most = n + rows.E.values.size();
  if (static_cast<std::size_t>(rows.E.rows) > most) {
    return unexpected(invalid("rows.E.rows", std::to_string(rows.E.rows),
                              "must be at most " + std::to_string(most) + ", the variables and entries"));
  }
  MARBLE_RETURN_IF_ERROR(check_part(rows.proximal, n, "rows.proximal"));
  for (std::size_t j = 0; j < rows.proximal.size(); ++j) {
    if (rows.proximal[j] < 0.0) {
      return unexpected(invalid("rows.proximal", static_cast<std::int64_t>(j),
                                std::to_string(rows.proximal[j]), "must be >= 0"));
    }
  }
  return check_part(rows.g, n, "rows.g");
}

// Numbers bound the count: each part that is present has `count` times its size.
Expected<void> check_count(Index count, bool have_numbers, const char* field) {
  if (count < 0) return unexpected(invalid(field, std::to_string(count), "must be >= 0"));
  if (count <= 1 || have_numbers) return {};
  return unexpected(invalid(field, std::to_string(count), "must be at most 1, as none has numbers"));
}

bool have_numbers(const ProblemUpdate& numbers) {
  bool any = false;
#define MARBLE_VECTOR(letter, field) any |= !numbers.letter.empty();
#define MARBLE_MATRIX(letter, field, values, vector) any |= !numbers.letter.empty();
#include "marble/contract.def"
  return any;
}

bool have_numbers(const AnswerWeights& w) {
  return !(w.z.empty() && w.equality_multipliers.empty() && w.inequality_multipliers.empty() &&
           w.complementarity_multipliers_L.empty() && w.complementarity_multipliers_R.empty());
}

PartSizes times(Index count, PartSizes sizes) {
  const auto factor = static_cast<std::size_t>(count);
#define MARBLE_VECTOR(letter, field) sizes.letter *= factor;
#define MARBLE_MATRIX(letter, field, values, vector) sizes.letter *= factor;
#include "marble/contract.def"
  return sizes;
}

double numbers_of(const PartSizes& sizes) {
  double numbers = 0.0;
#define MARBLE_VECTOR(letter, field) numbers += static_cast<double>(sizes.letter);
#define MARBLE_MATRIX(letter, field, values, vector) numbers += static_cast<double>(sizes.letter);
#include "marble/contract.def"
  return numbers;
}

}  // namespace

SensitivityRequest OwnedSensitivityRequest::view() const {
  SensitivityRequest request;
  request.directions.count = directions;
#define MARBLE_VECTOR(letter, field) request.directions.numbers.letter = numbers.letter;
#define MARBLE_MATRIX(letter, field, update, vector) \
  request.directions.numbers.letter = numbers.letter.values;
#include "marble/contract.def"
  request.losses = {losses,
                    {.z = z,
                     .equality_multipliers = equality_multipliers,
                     .inequality_multipliers = inequality_multipliers,
                     .complementarity_multipliers_L = complementarity_multipliers_L,
                     .complementarity_multipliers_R = complementarity_multipliers_R}};
  if (E.rows > 0) request.rows = RowsRequest{E.view(), proximal, g, columns};
  return request;
}

Expected<void> check(const SensitivityRequest& request, const PartSizes& sizes) {
  if (request.rows) {
    MARBLE_RETURN_IF_ERROR(check_rows(*request.rows, sizes.g));
  }
  const auto& [directions, numbers] = request.directions;
  MARBLE_RETURN_IF_ERROR(check_count(directions, have_numbers(numbers), "directions.count"));
  if (auto valid = times(directions, sizes).check(numbers); !valid)
    return unexpected(inside("directions", valid.error()));
  const auto& [losses, weights] = request.losses;
  MARBLE_RETURN_IF_ERROR(check_count(losses, have_numbers(weights), "losses.count"));
  if (auto valid = check(weights, times(losses, sizes)); !valid)
    return unexpected(inside("losses", valid.error()));
  return {};
}

Expected<void> check(const AnswerWeights& w, const PartSizes& sizes) {
  for (const auto& [values, size, field] :
       {std::tuple{w.z, sizes.g, "z"}, std::tuple{w.equality_multipliers, sizes.b, "equality_multipliers"},
        std::tuple{w.inequality_multipliers, sizes.d, "inequality_multipliers"},
        std::tuple{w.complementarity_multipliers_L, sizes.l, "complementarity_multipliers_L"},
        std::tuple{w.complementarity_multipliers_R, sizes.r, "complementarity_multipliers_R"}}) {
    MARBLE_RETURN_IF_ERROR(check_part(values, size, field));
  }
  return {};
}

double bytes_of(const SensitivityRequest& request, const PartSizes& sizes) {
  const auto n = static_cast<double>(sizes.g);
  const double answer = n + static_cast<double>(sizes.b + sizes.d + 2 * sizes.l);
  const double all = numbers_of(sizes);
  // At most four vectors for each of up to eight systems solved at once, and the solution in the user's
  // units.
  const Index most = std::max(
      {request.directions.count, request.losses.count, request.rows ? request.rows->E.rows : Index{0}});
  double numbers = (4.0 * std::min(8.0, 2.0 * most) + 1.0) * answer;
  if (request.rows) {
    const double m = request.rows->E.rows;
    numbers += 2.0 * static_cast<double>(request.rows->E.values.size()) + m * (2.0 + 0.5 * (m + 1.0));
    if (request.rows->columns) numbers += n * (1.0 + m);
  }
  numbers += answer * request.directions.count;
  if (most > 2) numbers += 2.0 / tuning::nearly_full * all;  // nearly full matrices, including their zeros
  numbers += all * request.losses.count;
  return numbers * sizeof(double);
}

}  // namespace marble
