#include "config.h"

#include <gtest/gtest.h>

namespace marble::server {
namespace {

TEST(Config, LoopbackAndUnixSocketsAreLocal) {
  for (const char* address : {"127.0.0.1:50051", "127.1.2.3:0", "[::1]:50051", "localhost:1",
                              "unix:/run/marble.sock", "unix-abstract:marble"}) {
    EXPECT_TRUE(is_local_address(address)) << address;
  }
}

TEST(Config, EverythingElseIsNot) {
  for (const char* address :
       {"0.0.0.0:50051", "[::]:50051", "10.0.0.1:1", "example.org:1", "127.0.0.1.example.org:1",
        "localhost.example.org:1", "dns:///localhost:1", "unixes.example.org:1", ":50051", ""}) {
    EXPECT_FALSE(is_local_address(address)) << address;
  }
}

TEST(Config, AFlagWinsOverTheEnvironmentAndBothOverTheDefault) {
  setenv("MARBLE_QUEUE_JOBS", "7", 1);
  setenv("MARBLE_WORKERS", "5", 1);
  std::string arguments[] = {"marble-server", "--workers", "3"};
  char* argv[] = {arguments[0].data(), arguments[1].data(), arguments[2].data()};
  int exit_code = 0;
  const auto config = read_config(3, argv, exit_code);
  unsetenv("MARBLE_QUEUE_JOBS");
  unsetenv("MARBLE_WORKERS");
  ASSERT_TRUE(config.has_value());
  EXPECT_EQ(config->workers, 3);
  EXPECT_EQ(config->queue_jobs, 7);
  EXPECT_EQ(config->message_bytes, Config().message_bytes);
}

}  // namespace
}  // namespace marble::server
