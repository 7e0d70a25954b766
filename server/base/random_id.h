// Ids that nobody guesses and that no two things share.
#pragma once

#include <string>

namespace marble::server {

/// 16 lower-case hexadecimal digits, not all zero.
[[nodiscard]] std::string random_id();

}  // namespace marble::server
