// Random ids that cannot be guessed and do not collide.
#pragma once

#include <string>

namespace marble::server {

/// 16 lower-case hexadecimal digits, not all zero.
[[nodiscard]] std::string random_id();

}  // namespace marble::server
