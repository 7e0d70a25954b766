// Problems and requests as JSON. Independent of protobuf and gRPC.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "marble/error.h"
#include "marble/problem.h"

namespace marble {

/// A problem in a JSON text.
struct JsonProblem {
  OwnedProblem problem;                        ///< checked
  std::optional<double> best_known_objective;  ///< if the text has it
};

/// Keys n, c0, g, Q, A, b, C, d, L, l, R, r, x0, name and best_known_objective; others are ignored. One pass
/// without a tree: memory is proportional to the numbers of these keys, at any nesting depth. A problem
/// without a name is called `name`. Errors: invalid_argument, by field and index as in the text.
[[nodiscard]] Expected<JsonProblem> parse_json(std::string_view text, const std::string& name);
/// Returns one line. Doubles keep every bit; a Q given by its upper triangle is written in full. The problem
/// must be valid.
[[nodiscard]] std::string write_json(const OwnedProblem& problem, std::optional<double> best_known_objective);

/// A request with a problem in it, as one JSON object.
struct JsonRequest {
  std::optional<JsonProblem> problem;  ///< if there is one
  std::string rest;                    ///< its other members, as a well-formed JSON object
};
/// Reads an object whose keys are `problem`, the problem, and any of `members`; or a problem alone, which
/// has none of these keys. Errors: invalid_argument, fields from the request's root.
[[nodiscard]] Expected<JsonRequest> parse_json_request(std::string_view text,
                                                       std::span<const std::string_view> members);

}  // namespace marble
