// URLs of pages, to which a page may link.
#pragma once

#include <string>

namespace marble::server {

inline constexpr std::size_t kLongestPageUrl = 256;

/// Returns the URL if it is one of http or https without user, path or spaces; else nothing.
[[nodiscard]] std::string checked_page(const std::string& url);

}  // namespace marble::server
