#include "output/json.h"

#include "plain_text.h"

namespace marble::cli {

Json to_json(const Error& error) {
  return {{"code", to_string(error.code)}, {"field", error.field}, {"index", error.index},
          {"value", error.value},          {"bound", error.bound}, {"message", error.message()}};
}

std::string line(const Json& json) {
  return with_escaped_controls(json.dump(-1, ' ', false, Json::error_handler_t::replace));
}

}  // namespace marble::cli
