// Reads the content of a file before its format is known.
#pragma once

#include <string>
#include <string_view>

#include "marble/error.h"
#include "marble/problem_file.h"

namespace marble::client {

/// Returns the content of a file, or of standard input if the path is "-". not_found if it cannot be read;
/// never empty.
[[nodiscard]] Expected<std::string> read_content(const std::string& path);

/// Returns the name of a file's problem that has no name of its own.
[[nodiscard]] std::string name_of_file(const std::string& path);

[[nodiscard]] Error too_large_file();

// Provides the JSON form of a problem file.
[[nodiscard]] Expected<ProblemFile> parse_json_file(std::string_view content, const std::string& name);

}  // namespace marble::client
