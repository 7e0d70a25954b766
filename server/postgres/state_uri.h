// What the setting `state` may be.
#pragma once

#include <string>

#include "marble/error.h"

namespace marble::server {

/// Errors: invalid_argument (not a URI of PostgreSQL; it holds a password, which others would see).
[[nodiscard]] Expected<void> check_state_uri(const std::string& uri);

}  // namespace marble::server
