// Provides output for programs: one JSON object per line.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "marble/error.h"

namespace marble::cli {

using Json = nlohmann::ordered_json;  // keys stay in the order of insertion

/// Copying and writing a parsed document recurses on the stack as deep as its nesting.
inline constexpr int kDeepestJson = 64;

/// Parses a text as JSON; discarded if it is invalid, or nested deeper than kDeepestJson.
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

/// Parses a text as a JSON object. Errors: invalid_argument without a field.
[[nodiscard]] Expected<nlohmann::json> parsed_object(std::string_view text);

/// {code, field, index, value, bound, message}.
[[nodiscard]] Json to_json(const Error& error);

/// Adds the tree's values of Progress and JobInfo (global search): incumbent, bound, gap, nodes, open_nodes.
/// JSON has no infinity: unknown values are null.
template <class Reported>
void add_tree(const Reported& reported, Json& json) {
  json["incumbent"] = reported.incumbent;
  json["bound"] = reported.bound;
  json["gap"] = reported.gap;
  json["nodes"] = reported.nodes;
  json["open_nodes"] = reported.open_nodes;
}

/// Returns the JSON without a line break; bytes that are not UTF-8, which file names may contain, are
/// replaced, and control characters escaped.
[[nodiscard]] std::string line(const Json& json);

}  // namespace marble::cli
