// Symptoms: `--listen 0.0.0.0:P` listened on IPv6 too, which a firewall for IPv4 left open. A server
// restarted on the port of one that was still ending failed at once with "in use, or no address of this
// machine".
#include <netinet/in.h>

#include "secure_service_test.h"

namespace marble::testing {
namespace {

class Address : public SecureServiceTest {};

TEST_F(Address, OfIpv4ListensOnIpv4Alone) {
  start(
      {"--listen", "0.0.0.0:0", "--insecure", "--tokens", write("tokens", new_token("planner:solve").line)});
  const std::string& address = server().address();
  const int six = socket(AF_INET6, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in6 name = {};
  name.sin6_family = AF_INET6;
  name.sin6_addr = in6addr_loopback;
  name.sin6_port = htons(static_cast<std::uint16_t>(std::stoi(address.substr(address.rfind(':') + 1))));
  EXPECT_NE(::connect(six, reinterpret_cast<const sockaddr*>(&name), sizeof name), 0);
  close(six);
}

TEST_F(Address, OfAServerThatIsStillEndingIsWaitedFor) {
  start();
  const std::string file = directory_.file("next address");
  ChildProcess next({MARBLE_SERVER_BINARY, "--listen", server().address(), "--http", "none", "--address-file",
                     file, "--listen-wait-s", "600"},
                    directory_.file("next log"));
  ASSERT_TRUE(eventually([&] { return next.output().find("address_in_use") != std::string::npos; }))
      << next.output();
  server().terminate();
  EXPECT_TRUE(eventually([&] { return std::filesystem::exists(file); })) << next.output();
  const auto stub = v1::Solver::NewStub(connect(read_file(file).substr(0, read_file(file).find('\n'))));
  grpc::ClientContext context;
  v1::SolveResponse response;
  EXPECT_TRUE(stub->Solve(&context, example_request(), &response).ok());
}

}  // namespace
}  // namespace marble::testing
