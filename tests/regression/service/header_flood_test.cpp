// Symptom: one connection that sent HEADERS without an end, and CONTINUATION frames after it, took 1.9 bytes
// of memory for each that it sent until the server was killed: 2 GB in 8 s, without credentials. gRPC 1.51
// looks at the size of each frame alone (as in CVE-2023-33953).
#include "service_test.h"
#include "support/raw_http2.h"

namespace marble::testing {
namespace {

class HeaderFlood : public ServiceTest {};

// One in ten was not ended: the thread that handed it to gRPC was also to end it, and gRPC kept that thread
// reading for as long as more came.
TEST_F(HeaderFlood, EndsEachConnection) {
  constexpr std::int64_t kMost = std::int64_t{2} << 30;
  start();
  std::string part;
  while (part.size() < 16'000) part += RawHttp2::fields({{"x-a", std::string(100, 'a')}});
  const std::string first = RawHttp2::frame(RawHttp2::kHeaders, RawHttp2::kNone, 1, part);
  const std::string more = RawHttp2::frame(RawHttp2::kContinuation, RawHttp2::kNone, 1, part);
  for (int i = 0; i < 30; ++i) {
    RawHttp2 raw(server().address());
    raw.begin(false);  // no other frame may stand among these
    raw.send(first);
    std::int64_t sent = 0;
    while (sent < kMost && raw.send(more)) sent += static_cast<std::int64_t>(more.size());
    ASSERT_LT(sent, kMost) << i;
  }
  EXPECT_LT(resident_bytes(server().pid()), 1 << 30);
  EXPECT_TRUE(eventually([&] {
    return !server().log_lines({"connection_closed", "flooding"}).empty();
  })) << server().log();
  EXPECT_TRUE(lives());
}

}  // namespace
}  // namespace marble::testing
