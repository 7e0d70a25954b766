// Checks the setting `state`.
#pragma once

#include <string>

#include "marble/error.h"

namespace marble::server {

/// Errors: invalid_argument (not a URI of PostgreSQL; it contains a password, which others could see).
[[nodiscard]] Expected<void> check_state_uri(const std::string& uri);

}  // namespace marble::server
