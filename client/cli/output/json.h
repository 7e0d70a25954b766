// What programs read: one JSON object a line.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "marble/error.h"

namespace marble::cli {

using Json = nlohmann::ordered_json;  // keys stay in the order in which they were written

/// {code, field, index, value, bound, message}.
[[nodiscard]] Json to_json(const Error& error);

/// What Progress, Solution and JobInfo tell of a tree (option global): bound, gap, nodes, open_nodes and,
/// where they have them, incumbent and warm_nodes. JSON has no infinity: what is not known is null.
template <class Told>
void add_tree(const Told& told, Json& json) {
  if constexpr (requires { told.incumbent; }) json["incumbent"] = told.incumbent;
  json["bound"] = told.bound;
  json["gap"] = told.gap;
  json["nodes"] = told.nodes;
  json["open_nodes"] = told.open_nodes;
  if constexpr (requires { told.warm_nodes; }) json["warm_nodes"] = told.warm_nodes;
}

/// Without a line break; bytes that are no UTF-8, as file names may hold, are replaced.
[[nodiscard]] std::string line(const Json& json);

}  // namespace marble::cli
