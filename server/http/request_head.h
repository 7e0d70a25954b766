// Checks the head of a request before httplib reads it: httplib ignores lines that it does not understand,
// and takes the first of two lengths. A proxy in front may read them differently, and take a body for the
// next request.
#pragma once

#include <string>
#include <string_view>

namespace marble::server::http {

/// Returns why RFC 9112 refuses a head, or empty. It is checked up to its empty line, or to its end: its
/// lines end with CR LF; fields have a name and are not folded; there is at most one Content-Length, of
/// digits only, and not together with a Transfer-Encoding; that is "chunked", once, and not in HTTP/1.0.
[[nodiscard]] std::string fault_of_head(std::string_view head);

}  // namespace marble::server::http
