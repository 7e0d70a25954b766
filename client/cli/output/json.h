// What programs read: one JSON object a line.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "marble/error.h"

namespace marble::cli {

using Json = nlohmann::ordered_json;  // keys stay in the order in which they were written

/// What is made of a text follows its nesting on the stack wherever it is copied or written.
inline constexpr int kDeepestJson = 64;

/// A text of JSON; discarded where it is none, or nested deeper than kDeepestJson.
template <class Document = Json>
[[nodiscard]] Document parsed(std::string_view text) {
  bool too_deep = false;
  const auto keep = [&too_deep](int depth, typename Document::parse_event_t, Document&) {
    too_deep = too_deep || depth > kDeepestJson;
    return !too_deep;
  };
  Document document = Document::parse(text, keep, false);
  return too_deep ? Document(Document::value_t::discarded) : document;
}

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

/// Without a line break; bytes that are no UTF-8, as file names may hold, are replaced, and control
/// characters escaped.
[[nodiscard]] std::string line(const Json& json);

}  // namespace marble::cli
