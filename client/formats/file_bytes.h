// Reads a file as bytes.
#pragma once

#include <string>

#include "marble/error.h"

namespace marble::formats {

/// Errors: not_found if it cannot be read.
[[nodiscard]] Expected<std::string> read_bytes(const std::string& path);

}  // namespace marble::formats
