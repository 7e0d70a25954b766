#include "base/page_url.h"

#include <algorithm>

namespace marble::server {

std::string checked_page(const std::string& url) {
  const std::size_t scheme = url.starts_with("https://") ? 8 : url.starts_with("http://") ? 7 : 0;
  const auto is_of_host = [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '.' ||
           c == '-' || c == '_' || c == ':' || c == '[' || c == ']';
  };
  const bool valid = scheme > 0 && url.size() > scheme && url.size() <= kLongestPageUrl &&
                     std::all_of(url.begin() + scheme, url.end(), is_of_host);
  return valid ? url : "";
}

}  // namespace marble::server
