// Symptom: one connection that sent HEADERS without an end, and CONTINUATION frames after it, took 1.9 bytes
// of memory for each that it sent until the server was killed: 2 GB in 8 s, without credentials. gRPC 1.51
// looks at the size of each frame alone (as in CVE-2023-33953).
#include "service_test.h"
#include "support/processes/raw_http2.h"

namespace marble::testing {
namespace {

class HeaderFlood : public ServiceTest {};

TEST_F(HeaderFlood, EndsTheConnection) {
  start();
  RawHttp2 raw(server().address());
  raw.begin();
  std::string part;
  while (part.size() < 16'000) part += RawHttp2::fields({{"x-a", std::string(100, 'a')}});
  raw.send(RawHttp2::frame(RawHttp2::kHeaders, RawHttp2::kNone, 1, part));
  const std::string more = RawHttp2::frame(RawHttp2::kContinuation, RawHttp2::kNone, 1, part);
  std::int64_t sent = 0;
  while (sent < std::int64_t{2} << 30 && raw.send(more)) sent += static_cast<std::int64_t>(more.size());
  EXPECT_LT(sent, std::int64_t{2} << 30);
  EXPECT_LT(resident_bytes(server().pid()), 1 << 30);
  EXPECT_TRUE(eventually([&] {
    return !server().log_lines({"connection_closed", "pouring"}).empty();
  })) << server().log();
  EXPECT_TRUE(lives());
}

}  // namespace
}  // namespace marble::testing
