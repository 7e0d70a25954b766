// Problems and requests as JSON. Knows nothing of protobuf and gRPC.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "marble/error.h"
#include "marble/problem.h"

namespace marble {

/// A problem as JSON has it.
struct JsonProblem {
  OwnedProblem problem;                        ///< checked
  std::optional<double> best_known_objective;  ///< where it has it
};

/// Keys n, c0, g, Q, A, b, C, d, L, l, R, r, x0, name and best_known_objective; others are ignored. One pass
/// and no tree: memory is in proportion to the numbers of these keys, however the text is nested. A problem
/// without a name is called `name`. Errors: invalid_argument, by field and index as the text has them.
[[nodiscard]] Expected<JsonProblem> parse_json(std::string_view text, const std::string& name);
/// One line. Doubles keep every bit; a Q by its upper triangle is written in full. The problem must be valid.
[[nodiscard]] std::string write_json(const OwnedProblem& problem, std::optional<double> best_known_objective);

/// A request with a problem in it, as one JSON object.
struct JsonRequest {
  std::optional<JsonProblem> problem;  ///< if there is one
  std::string rest;                    ///< its other members, as an object of JSON that is well-formed
};
/// An object whose keys are `problem`, the problem, and any of `members`; or a problem by itself, which has
/// none of these keys. Errors: invalid_argument, fields from the request's root.
[[nodiscard]] Expected<JsonRequest> parse_json_request(std::string_view text,
                                                       std::span<const std::string_view> members);

}  // namespace marble
