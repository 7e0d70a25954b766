#include "output/json.h"

#include "plain_text.h"

namespace marble::cli {

Expected<nlohmann::json> parsed_object(std::string_view text) {
  auto document = parsed<nlohmann::json>(text);
  if (document.is_object()) return document;
  return unexpected(
      invalid("", "must be a JSON object, nested at most " + std::to_string(kDeepestJson) + " deep"));
}

Json to_json(const Error& error) {
  return {{"code", to_string(error.code)}, {"field", error.field}, {"index", error.index},
          {"value", error.value},          {"bound", error.bound}, {"message", error.message()}};
}

std::string line(const Json& json) {
  return with_escaped_controls(json.dump(-1, ' ', false, Json::error_handler_t::replace));
}

}  // namespace marble::cli
