// Who accepts at a port, and who does not.
#include "net/port_probe.h"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <thread>

#include "support/loopback.h"

namespace marble::server {
namespace {

class PortProbe : public ::testing::Test {
 protected:
  PortProbe() { testing::listen_on(listener_, testing::loopback()); }
  ~PortProbe() override { close(listener_); }

  const int listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
};

TEST_F(PortProbe, SeesThatNobodyAccepts) {
  EXPECT_FALSE(ports_answer({listener_}, false, std::chrono::milliseconds(100)));
  EXPECT_FALSE(ports_answer({listener_}, true, std::chrono::milliseconds(100)));
}

TEST_F(PortProbe, WhoHangsUpAcceptsToo) {
  std::thread other([&] { close(accept(listener_, nullptr, nullptr)); });
  EXPECT_TRUE(ports_answer({listener_}, false, std::chrono::minutes(1)));
  other.join();
}

}  // namespace
}  // namespace marble::server
