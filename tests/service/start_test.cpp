// Starting: addresses, settings, and refusals in words.
#include <sched.h>

#include "service_test.h"

namespace marble::testing {
namespace {

class Start : public ServiceTest {
 protected:
  /// Runs the server to its end; for what must not start. -1 if it did.
  int run(const std::vector<std::string>& flags, const std::vector<std::string>& environment = {}) {
    std::vector<std::string> arguments = {MARBLE_SERVER_BINARY};
    arguments.insert(arguments.end(), flags.begin(), flags.end());
    ChildProcess process(arguments, directory_.file("output"), environment);
    const bool ended = eventually([&] { return !process.running(); });
    output_ = process.output();
    return ended ? process.wait() : -1;
  }
  [[nodiscard]] bool said(const std::string& text) const { return output_.find(text) != std::string::npos; }

  TemporaryDirectory directory_;
  std::string output_;
};

TEST_F(Start, ThereIsAWorkerForEachCoreThatItMayUse) {
  cpu_set_t all, first;
  ASSERT_EQ(sched_getaffinity(0, sizeof all, &all), 0);
  CPU_ZERO(&first);
  for (int core = 0; CPU_COUNT(&first) == 0; ++core) {
    if (CPU_ISSET(core, &all)) CPU_SET(core, &first);
  }
  ASSERT_EQ(sched_setaffinity(0, sizeof first, &first), 0);
  start();
  sched_setaffinity(0, sizeof all, &all);
  EXPECT_TRUE(eventually([&] {
    return !server().log_lines({"listening", "workers=1"}).empty();
  })) << server().log();
}

TEST_F(Start, ASecondServerOnThePortFailsAndNamesIt) {
  start();
  EXPECT_EQ(run({"--listen", server().address()}), 1);
  EXPECT_TRUE(said(server().address())) << output_;
  EXPECT_TRUE(said("in use")) << output_;
  EXPECT_TRUE(lives());
}

TEST_F(Start, ASecondServerLeavesTheUnixSocketToTheFirst) {
  const std::string address = "unix:" + directory_.file("socket");
  start({"--listen", address});
  EXPECT_EQ(run({"--listen", address}), 1);
  EXPECT_TRUE(said("in use")) << output_;
  EXPECT_TRUE(lives());
}

TEST_F(Start, AUnixSocketLeftBehindIsTakenOver) {
  const std::string address = "unix:" + directory_.file("socket");
  start({"--listen", address});
  server().send(SIGKILL);
  EXPECT_EQ(server().wait(), -SIGKILL);
  start({"--listen", address});
  EXPECT_TRUE(lives());
}

TEST_F(Start, TheAddressThatFailedIsTheOneNamed) {
  start();
  EXPECT_EQ(run({"--listen", "127.0.0.1:0", "--listen", server().address()}), 1);
  EXPECT_TRUE(said(server().address())) << output_;
}

TEST_F(Start, ListensOnEveryAddressGiven) {
  start({"--listen", "127.0.0.1:0", "--listen", "unix:" + directory_.file("socket")});
  ASSERT_EQ(server().addresses().size(), 2U);
  for (const std::string& address : server().addresses()) {
    const auto stub = v1::Solver::NewStub(connect(address));
    grpc::ClientContext context;
    v1::SolveResponse response;
    EXPECT_TRUE(stub->Solve(&context, example_request(), &response).ok()) << address;
  }
}

TEST_F(Start, RefusesOtherAddressesWithoutInsecure) {
  for (const char* address : {"0.0.0.0:0", "[::]:0", "192.0.2.1:50051", "example.org:1",
                              "127.0.0.1.example.org:1", "dns:///0.0.0.0:0", "ipv4:0.0.0.0:0"}) {
    EXPECT_EQ(run({"--listen", address}), 2) << address;
    EXPECT_TRUE(said("--insecure")) << output_;
  }
}

TEST_F(Start, ListensAnywhereWhenReported) {
  start({"--listen", "0.0.0.0:0", "--insecure", "--allow-anonymous"});
  // A server that listens on 127.0.0.1 alone does not hear this one.
  const std::string port = server().address().substr(server().address().rfind(':') + 1);
  const auto channel = grpc::CreateChannel("127.0.0.2:" + port, grpc::InsecureChannelCredentials());
  EXPECT_TRUE(channel->WaitForConnected(std::chrono::system_clock::now() + std::chrono::seconds(60)));
}

TEST_F(Start, RefusesUnknownFlagsAndValuesOutOfRange) {
  EXPECT_EQ(run({"--no-such-flag"}), 2);
  EXPECT_EQ(run({"--workers", "-1"}), 2);
  EXPECT_EQ(run({"--workers", "many"}), 2);
  EXPECT_EQ(run({"--log-level", "shout"}), 2);
  EXPECT_EQ(run({"--drain-grace-s", "nan"}), 2);
}

TEST_F(Start, RefusesAnEnvironmentOutOfRange) {
  EXPECT_EQ(run({}, {"MARBLE_WORKERS=-1"}), 2);
  EXPECT_TRUE(said("MARBLE_WORKERS") || said("workers")) << output_;
}

TEST_F(Start, HelpAndVersionAreNoErrors) {
  EXPECT_EQ(run({"--help"}), 0);
  EXPECT_TRUE(said("--queue-jobs") && said("--drain-grace-s") && said("MARBLE_WORKERS")) << output_;
  EXPECT_EQ(run({"--version"}), 0);
  EXPECT_TRUE(said("marble-server ")) << output_;
}

}  // namespace
}  // namespace marble::testing
