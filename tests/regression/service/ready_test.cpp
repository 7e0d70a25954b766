// Symptom: the listener of the gRPC port was dead, and /readyz said 200: nothing restarted the server. What
// it asks is tested in tests/server/port_probe_test.cpp; here that a server that is well says so, at
// whatever it listens.
#include "http_service_test.h"

namespace marble::testing {
namespace {

class Ready : public HttpServiceTest {};

TEST_F(Ready, AsksEveryAddressOfTheServer) {
  start({"--listen", "127.0.0.1:0", "--listen", "localhost:0", "--listen",
         "unix:" + directory_.file("socket")});
  const auto ready = get("/readyz");
  EXPECT_EQ(ready->status, 200) << ready->body;
}

TEST_F(Ready, AsksWithTlsToo) {
  TestAuthority authority;
  start(tls_flags(authority.issue_for_server()));
  httplib::Client client(server().http());
  client.enable_server_certificate_verification(false);
  const auto ready = client.Get("/readyz");
  ASSERT_TRUE(ready);
  EXPECT_EQ(ready->status, 200) << ready->body;
}

}  // namespace
}  // namespace marble::testing
