// Provides the JSON form of a problem file.
#pragma once

#include <string>
#include <string_view>

#include "marble/problem_file.h"

namespace marble::client {

[[nodiscard]] Expected<ProblemFile> parse_json_file(std::string_view content, const std::string& name);

}  // namespace marble::client
