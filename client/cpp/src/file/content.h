// What a file holds, before anybody knows its form.
#pragma once

#include <string>

#include "marble/error.h"

namespace marble::client {

/// Of a file, or of standard input where the path is "-". not_found if it cannot be read; never empty.
[[nodiscard]] Expected<std::string> read_content(const std::string& path);

/// What a problem in it is called that has no name of its own.
[[nodiscard]] std::string name_of_file(const std::string& path);

[[nodiscard]] Error too_large_file();

}  // namespace marble::client
