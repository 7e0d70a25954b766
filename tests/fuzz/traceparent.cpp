// A W3C traceparent: nothing, or ids of the right form that come back the same.
#include <cstdint>
#include <string_view>

#include "base/trace_context.h"
#include "expect.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace marble::server;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const std::string span = "00f067aa0ba902b7";
  const auto trace = parse_traceparent(text, span);
  if (!trace) return 0;
  FUZZ_EXPECT(trace->trace_id.size() == 32 && trace->parent_span_id.size() == 16 && trace->span_id == span);
  FUZZ_EXPECT(text.substr(3, 32) == trace->trace_id && text.substr(36, 16) == trace->parent_span_id);
  const auto passed_on = parse_traceparent(to_traceparent(*trace), span);
  FUZZ_EXPECT(passed_on && passed_on->trace_id == trace->trace_id && passed_on->parent_span_id == span);
  FUZZ_EXPECT(passed_on->flags == trace->flags);
  return 0;
}
