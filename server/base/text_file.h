// Reads small files as a whole.
#pragma once

#include <string>

#include "marble/error.h"

namespace marble::server {

/// Returns the file's bytes. Errors: not_found, with the path as value and the system's reason as bound.
[[nodiscard]] Expected<std::string> read_text_file(const std::string& path);

}  // namespace marble::server
