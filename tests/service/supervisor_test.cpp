// What systemd, or another owner of NOTIFY_SOCKET, receives: ready, reloading, stopping, in that order and
// not before.
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <cstring>

#include "service_test.h"

namespace marble::testing {
namespace {

/// A datagram socket as systemd has one.
class NotifySocket {
 public:
  /// `name` is a path, or begins with @ for an abstract name.
  explicit NotifySocket(const std::string& name) {
    sockaddr_un address = {};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path, name.data(), name.size());
    if (name[0] == '@') address.sun_path[0] = '\0';
    const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size());
    bound_ = bind(socket_, reinterpret_cast<const sockaddr*>(&address), length) == 0;
    setenv("NOTIFY_SOCKET", name.c_str(), 1);
  }
  ~NotifySocket() {
    unsetenv("NOTIFY_SOCKET");
    close(socket_);
  }
  [[nodiscard]] bool bound() const { return bound_; }
  /// The next message; empty if none came for a minute.
  [[nodiscard]] std::string next() const {
    pollfd waiting = {socket_, POLLIN, 0};
    char text[512];
    if (poll(&waiting, 1, 60'000) != 1) return "";
    const ssize_t size = recv(socket_, text, sizeof text, 0);
    return size > 0 ? std::string(text, static_cast<std::size_t>(size)) : "";
  }
  [[nodiscard]] bool silent() const {
    pollfd waiting = {socket_, POLLIN, 0};
    return poll(&waiting, 1, 0) == 0;
  }

 private:
  int socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  bool bound_ = false;
};

class Supervised : public ServiceTest {
 protected:
  TemporaryDirectory directory_;
};

TEST_F(Supervised, IsReportedWhenItAnswersReadsItsConfigurationAgainAndStops) {
  const NotifySocket systemd(directory_.file("notify"));
  ASSERT_TRUE(systemd.bound());
  start();
  EXPECT_EQ(systemd.next(), "READY=1");
  EXPECT_TRUE(lives());
  server().send(SIGHUP);
  EXPECT_EQ(systemd.next().rfind("RELOADING=1\nMONOTONIC_USEC=", 0), 0U);
  EXPECT_EQ(systemd.next(), "READY=1");
  EXPECT_TRUE(systemd.silent());
  server().terminate();
  EXPECT_EQ(systemd.next(), "STOPPING=1");
}

TEST_F(Supervised, HearsOfTheStopBeforeTheJobsHaveEnded) {
  const NotifySocket systemd(directory_.file("notify"));
  start({"--workers", "1", "--drain-grace-s", "3600"});
  EXPECT_EQ(systemd.next(), "READY=1");
  Stream running(solver(), long_request());
  ASSERT_TRUE(running.read_until(Event::kStarted));
  server().terminate();
  EXPECT_EQ(systemd.next(), "STOPPING=1");
  EXPECT_TRUE(running.read_until(Event::kProgress)) << "what runs goes on";
  server().terminate();
}

TEST_F(Supervised, MayListenAtAnAbstractName) {
  const NotifySocket systemd("@marble test " + std::to_string(getpid()));
  ASSERT_TRUE(systemd.bound());
  start();
  EXPECT_EQ(systemd.next(), "READY=1");
}

TEST_F(Supervised, MayBeGone) {
  setenv("NOTIFY_SOCKET", directory_.file("nobody").c_str(), 1);
  start();
  unsetenv("NOTIFY_SOCKET");
  EXPECT_TRUE(lives());
}

}  // namespace
}  // namespace marble::testing
