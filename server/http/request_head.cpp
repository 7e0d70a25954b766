#include "http/request_head.h"

#include <charconv>
#include <cstdint>
#include <optional>

#include "http/field_text.h"

namespace marble::server::http {
namespace {

bool is_length(std::string_view text) {
  std::int64_t length = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), length);
  return fault == std::errc() && end == text.data() + text.size() && text.front() != '-';
}

// Removes and returns the next line; empty if the rest has no valid line end.
std::optional<std::string_view> next_line(std::string_view& rest) {
  const std::size_t end = rest.find('\n');
  if (end == std::string_view::npos || end == 0 || rest[end - 1] != '\r') return std::nullopt;
  const std::string_view line = rest.substr(0, end - 1);
  rest.remove_prefix(end + 1);
  return line;
}

}  // namespace

std::string fault_of_head(std::string_view head) {
  const auto first = next_line(head);
  if (!first) return "the first line must end with CR LF";
  int lengths = 0, encodings = 0;
  while (!head.empty()) {
    const auto line = next_line(head);
    if (!line || line->find('\r') != std::string_view::npos)
      return "a header must be a line that ends with CR LF";
    if (line->empty()) break;
    const std::size_t colon = line->find(':');
    if (colon == std::string_view::npos || !is_token(line->substr(0, colon)))
      return "a header must be a name, a colon and a value";
    const std::string_view name = line->substr(0, colon), value = trimmed(line->substr(colon + 1));
    if (value.find('\0') != std::string_view::npos) return "a header must not have a NUL";
    if (equal(name, "content-length")) {
      if (++lengths > 1 || !is_length(value)) return "Content-Length must be there once, with digits alone";
    } else if (equal(name, "transfer-encoding")) {
      if (++encodings > 1 || !equal(value, "chunked"))
        return "Transfer-Encoding must be chunked, and there once";
    }
  }
  if (lengths > 0 && encodings > 0) return "Content-Length must not be beside Transfer-Encoding";
  if (encodings > 0 && !first->ends_with("HTTP/1.1")) return "Transfer-Encoding needs HTTP/1.1";
  return "";
}

}  // namespace marble::server::http
