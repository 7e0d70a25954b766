// What programs read: one JSON object a line.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "marble/error.h"

namespace marble::cli {

using Json = nlohmann::ordered_json;  // keys stay in the order in which they were written

/// {code, field, index, value, bound, message}.
[[nodiscard]] Json to_json(const Error& error);

/// Without a line break; bytes that are no UTF-8, as file names may hold, are replaced.
[[nodiscard]] std::string line(const Json& json);

}  // namespace marble::cli
