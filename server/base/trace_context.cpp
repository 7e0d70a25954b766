#include "base/trace_context.h"

#include <algorithm>
#include <cstdio>
#include <utility>

namespace marble::server {
namespace {

constexpr std::size_t kLength = 55;  // length in version 00: 2-32-16-2 digits
constexpr std::uint8_t kKnownFlags = 0x03;

bool is_hex(std::string_view text) {
  return text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}
bool is_zero(std::string_view text) { return text.find_first_not_of('0') == std::string_view::npos; }

std::uint8_t value_of(char digit) {
  return static_cast<std::uint8_t>(digit <= '9' ? digit - '0' : digit - 'a' + 10);
}

}  // namespace

std::optional<TraceContext> parse_traceparent(std::string_view text, std::string span_id) {
  if (text.size() < kLength || text[2] != '-' || text[35] != '-' || text[52] != '-') return std::nullopt;
  const std::string_view version = text.substr(0, 2);
  const std::string_view trace_id = text.substr(3, 32);
  const std::string_view parent = text.substr(36, 16);
  const std::string_view flags = text.substr(53, 2);
  if (!is_hex(version) || !is_hex(trace_id) || !is_hex(parent) || !is_hex(flags)) return std::nullopt;
  if (version == "ff" || is_zero(trace_id) || is_zero(parent)) return std::nullopt;
  // A later version may have more after another dash.
  const bool longer = text.size() > kLength;
  if (longer && (version == "00" || text[kLength] != '-')) return std::nullopt;
  const auto bits = static_cast<std::uint8_t>(value_of(flags[0]) << 4 | value_of(flags[1]));
  return TraceContext{std::string(trace_id), std::string(parent), std::move(span_id),
                      static_cast<std::uint8_t>(bits & kKnownFlags)};
}

std::string to_traceparent(const TraceContext& trace) {
  char flags[4];
  std::snprintf(flags, sizeof flags, "-%02x", unsigned{trace.flags});
  return "00-" + trace.trace_id + "-" + trace.span_id + flags;
}

}  // namespace marble::server
