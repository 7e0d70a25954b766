// Answers in fewer bytes, for who takes them so. httplib's own compression would also unpack what comes in.
#pragma once

#include <string>
#include <string_view>

namespace marble::server::http {

/// Whether an Accept-Encoding field, its lines joined by commas, prefers gzip to what is not encoded (RFC
/// 9110, 12.5.3). One that breaks the grammar accepts nothing.
[[nodiscard]] bool accepts_gzip(std::string_view accept_encoding);

/// The same bytes as a gzip file, packed fast rather than small; empty if there is no memory for it.
[[nodiscard]] std::string gzip(std::string_view bytes);

}  // namespace marble::server::http
