// The JSON form of a problem file.
#pragma once

#include <string>
#include <string_view>

#include "marble/problem_file.h"

namespace marble::client {

[[nodiscard]] Expected<ProblemFile> parse_json(std::string_view content, const std::string& name);
[[nodiscard]] std::string write_json(const ProblemFile& file);

}  // namespace marble::client
