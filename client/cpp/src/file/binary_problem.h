// Provides the binary form of a problem file: the message marble.v1.Problem.
#pragma once

#include <string>
#include <string_view>

#include "marble/problem_file.h"

namespace marble::client {

[[nodiscard]] Expected<ProblemFile> parse_binary(std::string_view content, const std::string& name);
[[nodiscard]] std::string write_binary(const ProblemFile& file);

}  // namespace marble::client
