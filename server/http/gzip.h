// Compresses replies for clients that accept it. httplib's own compression would also decompress requests.
#pragma once

#include <string>
#include <string_view>

namespace marble::server::http {

/// True if an Accept-Encoding field, its lines joined by commas, prefers gzip to no encoding (RFC 9110,
/// 12.5.3). An invalid field accepts nothing.
[[nodiscard]] bool accepts_gzip(std::string_view accept_encoding);

/// Returns the bytes as a gzip file, compressed for speed rather than size; empty if there is no memory for
/// it.
[[nodiscard]] std::string gzip(std::string_view bytes);

}  // namespace marble::server::http
