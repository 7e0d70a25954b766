// Reads the text of a problem or a request into parts whose sizes are not compared yet.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "marble/error.h"
#include "marble/problem.h"

namespace marble::json {

struct JsonMatrix {
  bool present = false;  ///< null counts as absent
  std::optional<Index> rows, columns;
  bool has_i = false, has_j = false, has_v = false;
  Triplets entries;
};

struct JsonVector {
  bool present = false;  ///< null counts as absent
  std::vector<double> values;
};

struct JsonParts {
  std::string name;
  std::optional<Index> n;
  std::optional<double> c0, best_known_objective;
  JsonVector x0;
#define MARBLE_VECTOR(letter, field) JsonVector letter;
#define MARBLE_MATRIX(letter, field, update, vector) JsonMatrix letter;
#include "marble/contract.def"
};

/// One pass without a tree: memory is proportional to the numbers of the known keys, at any nesting depth.
/// Checks types, and that numbers are finite and sizes are valid; errors name field and index.
[[nodiscard]] Expected<JsonParts> read_json_parts(std::string_view text);

struct JsonRequestParts {
  std::optional<JsonParts> problem;
  bool bare = false;       ///< the whole text is the problem
  std::string rest = "{";  ///< the other members, as one object
};

/// As described at parse_json_request(); also in one pass.
[[nodiscard]] Expected<JsonRequestParts> read_json_request(std::string_view text,
                                                           std::span<const std::string_view> members);

}  // namespace marble::json
