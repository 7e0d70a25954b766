// Parts of the values of header fields (RFC 9110, 5.6).
#pragma once

#include <algorithm>
#include <cctype>
#include <string_view>

namespace marble::server::http {

[[nodiscard]] inline bool is_token(std::string_view text) {
  return !text.empty() && std::ranges::all_of(text, [](unsigned char c) {
    return std::isalnum(c) != 0 ||
           std::string_view("!#$%&'*+-.^_`|~").find(static_cast<char>(c)) != std::string_view::npos;
  });
}

/// True if they are equal except for case; `lower` is in lower case.
[[nodiscard]] inline bool equal(std::string_view text, std::string_view lower) {
  return std::ranges::equal(
      text, lower, [](unsigned char a, char b) { return std::tolower(a) == static_cast<unsigned char>(b); });
}

/// Without spaces and tabs at the ends.
[[nodiscard]] inline std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t");
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t") - begin + 1);
}

}  // namespace marble::server::http
